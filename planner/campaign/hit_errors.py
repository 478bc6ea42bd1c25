"""Errors of hits as the simulation tells them, in words, and a campaign's modes without these."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.campaign.labels import LabelledPose, to_mode
from planner.campaign.state import Measurement
from planner.dataset.hit_columns import HitColumns
from planner.fit.hit_error_fit import (
    HitErrorFit,
    SolvedPoses,
    VisitHitErrors,
    VisitHits,
    fit_hit_errors,
)
from planner.fit.identified_robot import IdentifiedRobot
from planner.fit.posterior import FOLLOWED
from planner.frf.frf import Frf
from planner.inference.covariance import covariance_root
from planner.measurement.nuisances import ACROSS, HIT_NUMBERS, OF_HIT, Tolerances
from planner.modal.modes import Mode
from planner.modal.residues import laplace, residue_changes
from planner.recording.records import AXES
from planner.words import short_name

SURE = 2.0  # sds from which what hits have in common is told
Pair = tuple[float, float]
# Root mean square of the misses, in their sds before any data, from which they are not a hand's but
# what the simulation lacks: on an arm whose floor gave way unknown to it, it was 8 to 12; chosen.
NO_HAND = 4.0
AROUND = 0.5, 1.6  # of the band's edges: where other poles matter in it
UNIT = Tolerances(angle_rad=1.0, offset_m=1.0)


@dataclass(frozen=True)
class HitErrorEstimate:
    """A hit at r + o with direction e + δ: δ in ° and o in mm, each with its sd, in the tcp frame.

    The two numbers are those across the hit's axis, in cyclic order after it: x, y of a z hit.
    """

    file: str
    hit: str
    tilt_deg: Pair
    tilt_sd_deg: Pair
    offset_mm: Pair
    offset_sd_mm: Pair

    @property
    def cells(self) -> tuple[str, str, str]:
        """A row of a table: the hit and its file, how it tilts, where it lands."""
        tilt = _beside(self.tilt_deg, self.tilt_sd_deg, self.across, "°")
        named = f"{self.hit} {short_name(self.file, 16)}"
        return named, tilt, _beside(self.offset_mm, self.offset_sd_mm, self.across, " mm")

    @property
    def across(self) -> tuple[str, str]:
        """Letters of the two directions across its axis."""
        axis = AXES.index(self.hit[1])
        return AXES[(axis + 1) % 3], AXES[(axis + 2) % 3]


@dataclass(frozen=True, eq=False)
class Visited(VisitHits):
    """A pose with hits: its name, accepted files, and the tool's FRF, the average of all hits."""

    pose: str
    files: tuple[str, ...]
    frf: Frf


@dataclass(frozen=True, eq=False)
class CampaignHitErrors:
    """What is told of all poses with hits; `fitted` is None where there are none."""

    visited: tuple[Visited, ...]
    fitted: HitErrorFit | None
    tolerances: Tolerances
    band_hz: tuple[float, float]

    @property
    def trusted(self) -> bool:
        """Whether the simulation is right enough to tell how hits missed."""
        if self.fitted is None or self.fitted.discrepancy > FOLLOWED:
            return False
        sd = np.repeat([self.tolerances.angle_rad, self.tolerances.offset_m], 2)
        away = np.concatenate([visit.mean / sd for visit in self.fitted.visits])
        return bool(np.sqrt(np.mean(away**2)) < NO_HAND)

    @property
    def poses(self) -> dict[str, tuple[HitErrorEstimate, ...]]:
        """Hit by hit, by pose; none where the simulation is too wrong to tell."""
        return {pose: _pose(*each) for pose, each in self._told.items()} if self.trusted else {}

    @property
    def _told(self) -> dict[str, tuple[Visited, VisitHitErrors]]:
        """By pose, whether or not it is to be trusted."""
        if self.fitted is None:
            return {}
        both = zip(self.visited, self.fitted.visits, strict=True)
        return {visited.pose: (visited, told) for visited, told in both}

    def corrected(self, labelled: LabelledPose, measured: Measurement) -> LabelledPose:
        """A measured pose's labelled modes with residues as `without_hit_errors` gives them."""
        modes = [to_mode(mode) for mode in measured.modes]
        exact = {mode.frequency_hz: mode for mode in self.without_hit_errors(measured.pose, modes)}
        found = (None if mode is None else exact[mode.frequency_hz] for mode in labelled.modes)
        return replace(labelled, modes=tuple(found))

    def without_hit_errors(self, pose: str, modes: Sequence[Mode]) -> list[Mode]:
        """Modes with residues as hits without a miss would give them.

        What stays unsure is in their sds. Poles and shapes of response do not depend on where and
        how the robot is hit. Where the simulation is too wrong to tell, residues are as measured.
        """
        if pose not in self._told or not modes:
            return list(modes)
        visited, told = self._told[pose]
        if not self.trusted:
            return [_unsure(mode, visited.columns, self.tolerances) for mode in modes]
        return self._moved(modes, visited, told)

    def _moved(self, modes: Sequence[Mode], visited: Visited, told: VisitHitErrors) -> list[Mode]:
        assert self.fitted is not None
        frf, simulation = visited.frf, self.fitted.simulation
        lines = laplace(frf.frequency_hz, frf.exponential_rate_1_s, frf.tail_s)
        solved = SolvedPoses.of(simulation, visited.q[None])
        basis = solved.hit_error_columns(0, lines, UNIT)
        changes = _changes(visited.columns, told, basis, frf.frequency_hz)
        poles = np.array([mode.pole for mode in modes])
        outside = _outside(solved.poles[0], self.band_hz)
        moved = residue_changes(frf, poles, outside, self.band_hz, changes)
        # Of the real and of the imaginary part each.
        spread = np.sqrt(np.sum(np.abs(moved[1:]) ** 2, axis=0) / 2)
        return [
            replace(
                mode,
                residue=mode.residue - moved[0, k],
                residue_sd=np.hypot(mode.residue_sd, spread[k]),
            )
            for k, mode in enumerate(modes)
        ]


def estimate(
    visited: Sequence[Visited], fit: IdentifiedRobot, t: Tolerances, band_hz: tuple[float, float]
) -> CampaignHitErrors:
    """Misses of the hits of all poses, by the simulation as it was identified from them."""
    those = tuple(one for one in visited if len(one.columns.axis))
    told = fit_hit_errors(fit.posterior, those) if those else None
    return CampaignHitErrors(those, told, t, band_hz)


def _pose(visited: Visited, told: VisitHitErrors) -> tuple[HitErrorEstimate, ...]:
    columns = visited.columns
    sd = np.sqrt(np.diagonal(told.covariance)).reshape(-1, OF_HIT)
    hits = []
    for i, (axis, sign) in enumerate(zip(columns.axis, columns.sign, strict=True)):
        # A hit along −axis: the response is over the force along +axis, and so is its direction.
        hits.append(
            HitErrorEstimate(
                visited.files[columns.file[i]],
                ("+" if sign > 0 else "-") + AXES[axis],
                _pair(sign * np.rad2deg(told.mean[i, :2])),
                _pair(np.rad2deg(sd[i, :2])),
                _pair(1e3 * told.mean[i, 2:]),
                _pair(1e3 * sd[i, 2:]),
            )
        )
    return tuple(hits)


def _pair(values: np.ndarray) -> Pair:
    return float(values[0]), float(values[1])


def _changes(
    columns: HitColumns, told: VisitHitErrors, basis: np.ndarray, frequency_hz: np.ndarray
) -> np.ndarray:
    """(1 + 12, 3, 3, F): what the mean misses add to the FRF, and one sd of each unsure part."""
    share = columns.shared_at(frequency_hz)
    out = np.zeros((1 + HIT_NUMBERS, 3, 3, len(frequency_hz)), dtype=complex)
    whole = np.zeros((HIT_NUMBERS, told.mean.size))
    for i, axis in enumerate(columns.axis):
        out[0, :, axis] += np.einsum("k,kif,f->if", told.mean[i], basis[axis], share[i])
        at = OF_HIT * axis + np.arange(OF_HIT)
        whole[at, OF_HIT * i + np.arange(OF_HIT)] = np.mean(share[i])
    roots = covariance_root(whole @ told.covariance @ whole.T)
    for axis in range(3):
        part = roots[OF_HIT * axis : OF_HIT * axis + OF_HIT]
        out[1:, :, axis] = np.einsum("kj,kif->jif", part, basis[axis])
    return out


def _outside(poles: np.ndarray, band_hz: tuple[float, float]) -> np.ndarray:
    size, (low, high) = np.abs(poles) / (2 * np.pi), band_hz
    near = (size > AROUND[0] * low) & (size < AROUND[1] * high) & (poles.imag > 0)
    return poles[near & ((size < low) | (size > high))]


def _unsure(mode: Mode, columns: HitColumns, t: Tolerances) -> Mode:
    """As measured; its sds hold the hits' unknown directions.

    What a hit beside the point does cannot be said without a simulation.
    """
    sd = mode.residue_sd.copy()
    for axis, across in enumerate(ACROSS):
        count = max(int(np.sum(columns.axis == axis)), 1)
        power = np.nansum(np.abs(mode.residue[:, list(across)]) ** 2, axis=1)
        sd[:, axis] = np.hypot(sd[:, axis], t.angle_rad * np.sqrt(power / (2 * count)))
    return replace(mode, residue_sd=sd)


def systematic_errors(hits: Sequence[HitErrorEstimate]) -> tuple[str, ...]:
    """What errors along a signed axis have in common, where it is sure: a sentence an axis."""
    found = []
    for name in dict.fromkeys(hit.hit for hit in hits):
        group = [hit for hit in hits if hit.hit == name]
        place = _common([h.offset_mm for h in group], [h.offset_sd_mm for h in group])
        tilt = _common([h.tilt_deg for h in group], [h.tilt_sd_deg for h in group])
        said = []
        if lands := _sure(*place, group[0].across, " mm"):
            said.append(f"land {lands}")
        if tilts := _sure(*tilt, group[0].across, "°"):
            said.append(f"tilt by {tilts}")
        if said:
            axis = name.removeprefix("+").replace("-", "−")
            found.append(f"Your {axis} hits {' and '.join(said)}.")
    return tuple(found)


def _common(values: Sequence[Pair], sds: Sequence[Pair]) -> tuple[np.ndarray, np.ndarray]:
    """Mean (2,) and its sd: each hit scatters by itself, what is unsure is so of all alike."""
    each, n = np.array(values), len(values)
    scatter = np.var(each, axis=0, ddof=1) if n > 1 else np.zeros(2)
    return each.mean(axis=0), np.sqrt(scatter / n + np.mean(np.array(sds) ** 2, axis=0))


def _sure(mean: np.ndarray, sd: np.ndarray, across: tuple[str, str], unit: str) -> str:
    told = np.abs(mean) > SURE * sd
    chosen = [(m, s, a) for m, s, a, sure in zip(mean, sd, across, told, strict=True) if sure]
    return " and ".join(
        f"{abs(m):.{_digits(s)}f} ± {s:.{_digits(s)}f}{unit} towards {'+' if m > 0 else '−'}{a}"
        for m, s, a in chosen
    )


def _digits(sd: float) -> int:
    """Places after the point that one figure of an sd needs, two at most."""
    return 0 if sd >= 0.95 else 1 if sd >= 0.095 else 2


def _beside(values: Pair, sds: Pair, across: tuple[str, str], unit: str) -> str:
    both = zip(across, values, sds, strict=True)
    return ", ".join(f"{a} {v:+.{_digits(s)}f} ± {s:.{_digits(s)}f}{unit}" for a, v, s in both)
