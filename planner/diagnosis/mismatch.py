"""How much and where simulation and recordings differ, as the answer of `diagnose` states it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from planner.fit.misfit import FrfMisfit
from planner.fit.posterior import RobotPosterior
from planner.words import significant

if TYPE_CHECKING:
    from planner.diagnosis.diagnose import Diagnosis
    from planner.fit.data import FrfData
    from planner.fit.fitted import StructureFit

BANDS = 12
CLEARLY = 2.0  # mean square residual, 1 at the noise, from which a place differs
OF_LARGEST = 0.25  # that makes a band, pose or direction one of those


@dataclass(frozen=True, eq=False)
class Residuals:
    """Mean squares of what a fit leaves: by band (k,), pose (n,), response and hit (3, 3).

    1 is noise and what just does not matter ([diagnose] matters_percent) together; `edges_hz`
    (k + 1,) are the bands'.
    """

    edges_hz: np.ndarray
    by_band: np.ndarray
    by_pose: np.ndarray
    by_direction: np.ndarray

    @classmethod
    def of(cls, fit: "StructureFit", band_hz: tuple[float, float], matters: float) -> "Residuals":
        """Of a fit on its lines, the likeliest misses of hits and chain taken out."""
        measured = fit.misfit.data.measured
        noise = np.hypot(measured.sd, matters * fit.misfit.data.weights.size)
        square = np.where(
            measured.used, np.abs(RobotPosterior.of(fit).residual / noise) ** 2, np.nan
        )
        edges = np.linspace(*band_hz, BANDS + 1)
        place = np.clip(np.searchsorted(edges, measured.frequency_hz, "right") - 1, 0, BANDS - 1)
        bands = [np.where((place == k)[:, None, None], square, np.nan) for k in range(BANDS)]
        rows = [[_mean(square[:, i::3, j::3]) for j in range(3)] for i in range(3)]
        by_band, by_pose = (np.array([_mean(one) for one in of]) for of in (bands, square))
        return cls(edges, by_band, by_pose, np.array(rows))


def _mean(values: np.ndarray) -> float:
    known = np.isfinite(values)
    return float(values[known].mean()) if known.any() else 0.0


@dataclass(frozen=True)
class MismatchPlaces:
    """Where the refitted simulation misses the recordings clearly."""

    bands_hz: list[list[float]]
    poses: tuple[str, ...]
    directions: list[str]

    @classmethod
    def of(cls, found: Residuals, poses: tuple[str, ...]) -> "MismatchPlaces":
        """What stands out, neighbouring bands joined."""
        bands: list[list[float]] = []
        for k in _standing_out(found.by_band):
            low, high = map(float, found.edges_hz[k : k + 2])
            if bands and bands[-1][1] == low:
                bands[-1][1] = high
            else:
                bands.append([low, high])
        names = dict.fromkeys(poses[i] for i in _standing_out(found.by_pose))
        axes = _standing_out(found.by_direction.mean(axis=1))
        return cls(bands, tuple(names), ["xyz"[i] for i in axes])

    @property
    def sentence(self) -> str:
        """For the engineer."""
        if not self.bands_hz:
            return "Once refitted, the simulation is clearly off in no frequency band."
        bands = ", ".join(f"{low:.0f} to {high:.0f}" for low, high in self.bands_hz)
        where = f", at poses {', '.join(self.poses)}" if self.poses else ""
        along = f", along {', '.join(self.directions)}" if self.directions else ""
        off = f"the simulation is clearly off at {bands} Hz{where}{along}"
        return f"With its own springs refitted and nothing added, {off}."


def _standing_out(values: np.ndarray) -> list[int]:
    return np.flatnonzero((values > CLEARLY) & (values > OF_LARGEST * values.max())).tolist()


@dataclass(frozen=True)
class TwoMisfits:
    """χ² per value, refitted and with what explains it; 1: noise, and what just does not matter."""

    refitted: float
    explained: float


@dataclass(frozen=True)
class MismatchShares:
    """Mean square of mismatch over that of the recordings, in dB, at the used poses.

    Of the simulation as stated, refitted, and with what explains it; `left` is what remains of the
    last once misses of hits and the chain's tolerances are taken out: noise, or physics.
    """

    stated: float
    refitted: float
    explained: float
    left: float

    @classmethod
    def of(cls, found: "Diagnosis") -> "MismatchShares":
        """Of a diagnosis."""
        measured = found.best.misfit.data.measured
        used = measured.used
        sides = simulated(found, found.best.misfit.data)
        off = [h - measured.accelerance for h in sides] + [found.robot.residual]
        recorded = max(float(np.sum(np.abs(measured.accelerance[used]) ** 2)), 1e-300)
        shares = (float(np.sum(np.abs(one[used]) ** 2)) / recorded for one in off)
        return cls(*(round(10 * float(np.log10(max(share, 1e-12))), 2) for share in shares))

    @property
    def sentence(self) -> str:
        """For the engineer."""
        sides = self.stated, self.refitted, self.explained, self.left
        stated, refitted, explained, left = (significant(100 * 10 ** (db / 20)) for db in sides)
        text = (
            f"The simulation is off from the measured FRFs by {stated} % (root mean square) as "
            f"robot.toml states it, by {refitted} % once its own springs, dampers and masses are "
            f"refitted, and by {explained} % with what was found. Once the likeliest errors of "
            f"hits and sensor are taken out too, {left} % remains."
        )
        if self.refitted <= self.stated:
            return text
        return (
            f"{text} Refitted alone, peaks are farther off than as stated: no values of its own "
            f"springs bring it to the recordings, so that the fit gives up the peaks."
        )


def simulated(found: "Diagnosis", data: "FrfData") -> list[np.ndarray]:
    """What the sensors hear (n, r, c, F) in m/s²/N: as stated, refitted, and explained."""
    stated = found.search.prior.stated(data.sensors)
    sides = [(stated, stated.mean), *((f.structure, f.at.x) for f in (found.refitted, found.best))]
    out = []
    for structure, x in sides:
        misfit = FrfMisfit(structure, data, found.search.tolerances)
        out.append(misfit.through_chain(x, misfit.motion(x, None).accelerance))
    return out
