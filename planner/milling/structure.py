"""What is known of the structure in the plane of a cut, from modes or from FRFs."""

from dataclasses import dataclass, replace

import msgspec
import numpy as np
from scipy.optimize import nnls
from scipy.stats import norm, qmc

from planner.errors import InputError
from planner.milling.cut import Cut
from planner.milling.cutter_frf import CutterFrf
from planner.milling.cutter_modes import CutterFit, CutterModes, ModeFile, hidden_below
from planner.milling.directional import mean_matrix
from planner.milling.lobes import OPEN, REPLICATES
from planner.milling.machine import LobeCurves, Machine, check_structure

STEP = 1e-4  # relative, of derivatives
MOST_DAMPING = 0.95


def moved(modes: CutterModes, by: np.ndarray) -> CutterModes:
    """Modes with relative changes (3m + 1,), m the number of distinct poles.

    Of every frequency, every damping, every size, and all sizes together. A mode keeps its mass
    where its frequency changes; damping and sizes change by factors e^x.
    """
    _, group = np.unique(modes.poles, return_inverse=True)
    frequency, damping, size = (part[group] for part in np.split(by[:-1], 3))
    omega = np.abs(modes.poles) * np.exp(frequency)
    own = -modes.poles.real / np.abs(modes.poles)
    # A fit may bring a pole that is more damped: that stays, or nothing changed would change it.
    zeta = np.minimum(own * np.exp(damping), np.maximum(own, MOST_DAMPING))
    damped = omega * np.sqrt(1 - zeta**2)
    factor = np.exp(size + by[-1]) * modes.poles.imag / damped
    return replace(
        modes,
        poles=-zeta * omega + 1j * damped,
        shapes=modes.shapes * factor[:, None],
        residual=modes.residual * np.exp(by[-1]),
    )


def explaining(modes: CutterModes, frf: CutterFrf) -> tuple[np.ndarray, float]:
    """Sds (3m + 1,) of such changes that explain an FRF's, and the share of its variance given."""
    count = len(np.unique(modes.poles))
    if frf.sd is None or not np.any(frf.sd > 0):
        return np.zeros(3 * count + 1), 1.0
    # Most lines of an FRF, that its sd is explained at
    every = max(1, len(frf.frequency_hz) // 300)
    hertz, sd = frf.frequency_hz[::every], frf.sd[..., ::every].transpose(2, 0, 1)
    here = modes.receptance(hertz)
    each = (moved(modes, by).receptance(hertz) for by in STEP * np.eye(3 * count + 1))
    columns = [np.abs((there - here) / STEP) ** 2 for there in each]
    scale = np.sum(np.abs(here) ** 2, axis=(1, 2))[:, None, None]
    wanted = sd**2 / scale
    # Line by line alike: few lines of which hardly anything is known say nothing of the others.
    size = np.sum(wanted, axis=(1, 2))[:, None, None]
    # Least share of the median variance over the lines: none counts as if it were known better
    size = np.maximum(size, 1e-3 * np.median(size))
    a = np.stack([(column / scale / size).ravel() for column in columns], axis=1)
    wanted = (wanted / size).ravel()
    unit = np.linalg.norm(a, axis=0)
    unit[unit == 0] = np.inf
    square = nnls(a / unit, wanted)[0] / unit
    given = float(np.sum(a @ square) / np.sum(wanted))
    # Most sd of ln frequency, damping or size: nothing is known of a mode that is less sure
    return np.minimum(np.sqrt(square), 0.5), given


def sampled(
    machine: Machine, spread: np.ndarray, sds: tuple[float, float], count: int, seed: int
) -> list[Machine]:
    """So many samples, a Latin hypercube, by relative sds of modes (3m + 1,) and of K_t, K_r."""
    numbers = np.append(spread, sds)
    points = qmc.LatinHypercube(len(numbers), rng=np.random.default_rng(seed)).random(count)
    normal = norm.ppf(points) * numbers
    found = []
    for row in normal:
        # Least coefficient of the stated one: a sample of K_t is not below
        kt, kr = 1 + np.maximum(row[-2:], 0.05 - 1)
        k = {"kt_n_m2": machine.cut.kt_n_m2 * kt, "kr_n_m2": machine.cut.kr_n_m2 * kr}
        cut = msgspec.structs.replace(machine.cut, **k)
        found.append(Machine(moved(machine.modes, row[:-2]), cut))
    return found


ROUNDING = 1e-5  # relative error of a fit that is one of rounding in a file
SAMPLES = 200
SEED = 11  # of samples: the same answer for the same question


class OutOfBandError(InputError):
    """The cut would chatter where the FRFs have no lines."""


@dataclass(frozen=True, eq=False)
class Structure:
    """Modes in the cut's plane, and the FRFs that they are from, if any.

    `spread` (3m + 1,) are relative sds of what `moved` changes. Modes from FRFs
    without a stated sd are as uncertain as their `fit` is by the FRFs' noise.
    """

    modes: CutterModes
    spread: np.ndarray
    frf: CutterFrf | None = None
    remarks: tuple[str, ...] = ()
    fit: CutterFit | None = None

    def machine(self, cut: Cut) -> Machine:
        """With a cut and its coefficients as stated."""
        return Machine(self.modes, cut)

    def samples(self, cut: Cut, count: int = SAMPLES) -> list[Machine]:
        """So many machines that are as likely as each other; none where nothing is uncertain."""
        sds = cut.kt_sd_percent / 100, cut.kr_sd_percent / 100
        if not count or not (np.any(self.spread > 0) or any(sds) or self.fit is not None):
            return []
        machine, each = self.machine(cut), -(-count // REPLICATES)
        drawn = [
            sample for part in range(REPLICATES)
            for sample in sampled(machine, self.spread, sds, each, SEED + part)
        ]  # fmt: skip
        if self.fit is not None:
            own = self.fit.drawn(len(drawn), SEED)
            drawn = [replace(one, modes=modes) for one, modes in zip(drawn, own, strict=True)]
        return drawn


def of_modes(file: ModeFile, cut: Cut) -> Structure:
    """From stated modes and their sds; InputError where none moves in the plane of the cut."""
    modes = file.modes.in_plane(cut.plane)
    check_structure(modes)
    poles = np.unique(modes.poles)
    of_pole = {
        complex(pole): row for pole, row in zip(file.modes.poles, file.relative_sds, strict=True)
    }
    sds = np.array([of_pole[complex(pole)] for pole in poles])
    return Structure(modes, np.append(sds.T, 0.0))


def of_frf(frf: CutterFrf, cut: Cut) -> Structure:
    """From FRFs, predicted with an sd or measured: modes are fitted, and how well is said."""
    plane, mean = frf.in_plane(cut), mean_matrix(cut)
    if plane.sd is not None:
        h = plane.receptance.transpose(2, 0, 1)
        check_band(plane, LobeCurves(plane.frequency_hz, h, mean))
    fit = CutterFit(plane)
    check_structure(fit.modes)
    if plane.sd is None:
        floor = Machine(fit.modes, cut).floor().floor_m
        # Lines in the noise tell nothing of modes below, whose flank may seem to matter there.
        told = plane.frequency_hz > (hidden_below(fit, mean, floor) or 0.0)
        check_band(plane, LobeCurves(plane.frequency_hz, fit.receptance(told), mean), told)
    spread, given = explaining(fit.modes, plane)
    count = len(np.unique(fit.modes.poles))
    remarks = [
        *plane.remarks,
        f"{count} modes fitted to {plane.name} leave {100 * fit.found.fit_error:.2g} % of the "
        f"accelerance.",
    ]
    if np.any(spread > 0):
        remarks.append(
            f"Depths at 95 %: frequency, damping and size of each mode are drawn so that the FRFs "
            f"scatter by {100 * np.sqrt(given):.0f} % of their sd."
        )
    noisy = fit if plane.sd is None and fit.found.fit_error > ROUNDING else None
    return Structure(fit.modes, spread, plane, tuple(remarks), noisy)


def check_band(frf: CutterFrf, found: LobeCurves, told: np.ndarray | None = None) -> None:
    """OutOfBandError where chatter would be at the end of the FRFs' lines, or beyond.

    Or at the first of the lines (F,) bool that tell of modes below, where it is not theirs.
    """
    lines = frf.frequency_hz
    if not np.isfinite(found.floor_m):
        where = "at no frequency within them"
    elif found.floor_hz in (lines[0], lines[-1]):
        where = "at their very end or beyond"
    elif told is not None and np.any(told) and found.floor_hz == lines[told][0]:
        where = f"below {found.floor_hz:.3g} Hz, where noise hides the mode"
    else:
        return
    raise OutOfBandError(
        f"{frf.name}: the FRFs reach from {lines[0]:.6g} to {lines[-1]:.6g} Hz and the cut would "
        f"chatter {where}; measure over the band of the modes that chatter."
    )


def out_of_band_remark(structure: Structure, chatter_hz: np.ndarray) -> str | None:
    """A sentence where chatter (n,), NaN where there is none, lies outside the lines of the FRFs.

    Where none is found, what lies beyond may still limit the cut. None: it is all within them.
    """
    if structure.frf is None:
        return None
    lines = structure.frf.frequency_hz
    band = f"{lines[0]:g} to {lines[-1]:g} Hz"
    free = int(np.sum(np.isnan(chatter_hz)))
    count = int(np.sum((chatter_hz < lines[0]) | (chatter_hz > lines[-1])))
    said = []
    if count:
        said.append(
            f"At {count} of the speeds the cut would chatter outside the FRFs' {band}, where the "
            f"fitted modes only guess: measure there too."
        )
    if free:
        said.append(
            f"At {free} of the speeds no mode within {band} limits the depth: modes beyond, which "
            f"were not measured, may."
        )
    return " ".join(said) or None


def limit_remarks(
    structure: Structure, cut: Cut, depth_m: np.ndarray, known: np.ndarray
) -> list[str]:
    """On limits (n,) in m, inf where there is none, and whether samples agree on them."""
    fit, said = structure.fit, []
    if fit is None:
        return []
    if not np.all(known):
        said.append(
            f"Lines or noise of these FRFs do not suffice at {np.sum(~known)} of {len(known)} "
            f"speeds: they leave the limit open by more than ± {100 * OPEN:.0f} %. Measure at "
            f"finer lines or average more hits."
        )
    most = float(np.max(np.where(np.isfinite(depth_m), depth_m, cut.depth_m[1])))
    hidden = hidden_below(fit, mean_matrix(cut), most)
    if hidden is not None:
        said.append(
            f"Below {hidden:.2g} Hz noise and lines of these FRFs would hide a mode that chatters "
            f"at less: the limits hold if the structure has none there."
        )
    return said
