"""What is known of the structure in the plane of a cut, from modes or from FRFs."""

from dataclasses import dataclass, replace

import numpy as np

from planner.errors import InputError
from planner.milling.cut import Cut
from planner.milling.cutter_fit import CutterFit, hidden_below
from planner.milling.cutter_frf import EXACT, CutterFrf
from planner.milling.cutter_modes import CutterModes, ModeFile
from planner.milling.directional import Coefficients, mean_matrix
from planner.milling.machine import Machine, check_structure
from planner.milling.spread import ModeSpread, explaining, sampled
from planner.milling.uncertainty import REPLICATES
from planner.milling.zeroth_order import LobeCurves, curves

ROUNDING = 1e-5  # relative error of a fit that is one of rounding in a file
SAMPLES = 200
SEED = 11  # of samples: the same answer for the same question


class OutOfBandError(InputError):
    """The cut would chatter where the FRFs have no lines."""


@dataclass(frozen=True, eq=False)
class Structure:
    """Modes in the cut's plane, how uncertain they are, and the FRFs that they are from, if any.

    Modes from FRFs without a stated sd are as uncertain as their `fit` is by the FRFs' noise.
    """

    modes: CutterModes
    spread: ModeSpread
    frf: CutterFrf | None = None
    remarks: tuple[str, ...] = ()
    fit: CutterFit | None = None

    def machine(self, cut: Cut) -> Machine:
        """With a cut and its coefficients as stated."""
        return Machine(self.modes, cut, Coefficients.of(cut))

    def samples(self, cut: Cut, count: int = SAMPLES, seed: int = SEED) -> list[Machine]:
        """So many machines that are as likely as each other; none where nothing is uncertain."""
        sds = cut.kt_sd_percent / 100, cut.kr_sd_percent / 100
        if not self.spread.any and not any(sds) and self.fit is None:
            return []
        k, each = Coefficients.of(cut), -(-count // REPLICATES)
        drawn = [
            sample for part in range(REPLICATES)
            for sample in sampled(self.modes, self.spread, k, sds, each, seed + part)
        ]  # fmt: skip
        if self.fit is not None:
            own = self.fit.drawn(len(drawn), seed)
            drawn = [(modes, k) for modes, (_, k) in zip(own, drawn, strict=True)]
        machine = self.machine(cut)
        return [replace(machine, modes=modes, coefficients=k) for modes, k in drawn]


def of_modes(file: ModeFile, cut: Cut) -> Structure:
    """From stated modes and their sds; InputError where none moves in the plane of the cut."""
    modes = file.modes.in_plane(cut.plane)
    check_structure(modes)
    poles = np.unique(modes.poles)
    of_pole = {
        complex(pole): row for pole, row in zip(file.modes.poles, file.relative_sds, strict=True)
    }
    sds = np.array([of_pole[complex(pole)] for pole in poles])
    return Structure(modes, ModeSpread(*sds.T))


def of_frf(frf: CutterFrf, cut: Cut) -> Structure:
    """From FRFs, predicted with an sd or measured: modes are fitted, and how well is said."""
    plane = frf.in_plane(cut)
    fit = CutterFit.of(plane) if plane.sd is None else None
    if fit is None or (fit.error > ROUNDING and plane.error(plane.fitted()) < EXACT):
        return _computed(plane, cut)  # or without noise: what modes outside the lines add counts
    return _measured(fit, plane, cut)


def _measured(fit: CutterFit, plane: CutterFrf, cut: Cut) -> Structure:
    mean = mean_matrix(cut, Coefficients.of(cut))
    check_structure(fit.modes)
    floor = Machine(fit.modes, cut, Coefficients.of(cut)).floor().floor_m
    # Lines in the noise tell nothing of modes below, whose flank may seem to matter there.
    told = plane.frequency_hz > (hidden_below(fit, mean, floor) or 0.0)
    check_band(plane, curves(plane.frequency_hz, fit.receptance(told), mean), told)
    count = len(np.unique(fit.modes.poles))
    said = f"{count} modes fitted to {plane.name} leave {100 * fit.error:.2g} % of the accelerance."
    noisy = fit if fit.error > ROUNDING else None
    return Structure(fit.modes, ModeSpread.none(count), plane, (*plane.remarks, said), noisy)


def _computed(plane: CutterFrf, cut: Cut) -> Structure:
    mean = mean_matrix(cut, Coefficients.of(cut))
    check_band(plane, curves(plane.frequency_hz, plane.receptance.transpose(2, 0, 1), mean))
    modes = plane.fitted()
    check_structure(modes)
    error = plane.error(modes)
    spread, given = explaining(modes, plane)
    remarks = [
        *plane.remarks,
        f"{len(np.unique(modes.poles))} modes fitted to {plane.name} are off by {100 * error:.2g} "
        f"% of the FRFs (root mean square over the lines).",
    ]
    if spread.any:
        remarks.append(
            f"The FRFs' sd is sampled as independent errors of each mode's frequency, damping and "
            f"size, which give {100 * given:.0f} % of its square."
        )
    return Structure(modes, spread, plane, tuple(remarks))


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


def beyond(structure: Structure, chatter_hz: np.ndarray) -> str | None:
    """A sentence where chatter (n,) lies outside the lines of the FRFs; None where none does."""
    if structure.frf is None:
        return None
    lines = structure.frf.frequency_hz
    with np.errstate(invalid="ignore"):
        count = int(np.sum((chatter_hz < lines[0]) | (chatter_hz > lines[-1])))
    if not count:
        return None
    return (
        f"At {count} of the speeds the cut would chatter outside the FRFs' {lines[0]:g} to "
        f"{lines[-1]:g} Hz, where the fitted modes only guess: measure there too."
    )
