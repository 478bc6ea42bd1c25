"""What is known of the structure in the plane of a cut, from modes or from FRFs."""

from dataclasses import dataclass

import numpy as np

from planner.errors import InputError
from planner.milling.cut import Cut
from planner.milling.cutter_frf import CutterFrf, PlaneFrf
from planner.milling.cutter_modes import CutterModes
from planner.milling.directional import Coefficients, mean_matrix
from planner.milling.machine import Machine, check_structure
from planner.milling.mode_file import ModeFile
from planner.milling.spread import ModeSpread, explaining, sampled
from planner.milling.uncertainty import REPLICATES, with_samples
from planner.milling.zeroth_order import curves

POOR_FIT = 0.05  # relative error of a modal fit that is warned of
SAMPLES = 200
SEED = 11  # of samples: the same answer for the same question


class OutOfBandError(InputError):
    """The cut would chatter where the FRFs have no lines."""


@dataclass(frozen=True, eq=False)
class Structure:
    """Modes in the cut's plane, how uncertain they are, and the FRFs that they are from, if any."""

    modes: CutterModes
    spread: ModeSpread
    frf: PlaneFrf | None = None
    remarks: tuple[str, ...] = ()

    def machine(self, cut: Cut) -> Machine:
        """With a cut and its coefficients as stated."""
        return Machine(self.modes, cut, Coefficients.of(cut), self.frf)

    def samples(self, cut: Cut, count: int = SAMPLES, seed: int = SEED) -> list[Machine]:
        """So many machines that are as likely as each other; none where nothing is uncertain."""
        sds = cut.kt_sd_percent / 100, cut.kr_sd_percent / 100
        if not self.spread.any and not any(sds):
            return []
        k, each = Coefficients.of(cut), -(-count // REPLICATES)
        drawn = [
            sample for part in range(REPLICATES)
            for sample in sampled(self.modes, self.spread, k, sds, each, seed + part)
        ]  # fmt: skip
        return with_samples(self.machine(cut), drawn)


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
    """From FRFs and their sd: modes are fitted, and how well is said."""
    plane = frf.in_plane(cut)
    check_band(plane, cut)
    modes = plane.fitted()
    check_structure(modes)
    error = plane.error(modes)
    spread, given = explaining(modes, plane)
    count = len(np.unique(modes.poles))
    remarks = [
        f"{count} modes fitted to {frf.name} are off by {100 * error:.2g} % of the FRFs (root mean "
        f"square over the lines)."
    ]
    if error > POOR_FIT and cut.method != "zeroth_order":
        remarks.append('The fit is poor; method = "zeroth_order" takes the FRFs as they are.')
    if frf.sd is None:
        remarks.append("These FRFs come without sd: they are taken as exact.")
    elif spread.any:
        remarks.append(
            f"The FRFs' sd is sampled as independent errors of each mode's frequency, damping and "
            f"size, which give {100 * given:.0f} % of its square."
        )
    return Structure(modes, spread, plane, tuple(remarks))


def check_band(frf: PlaneFrf, cut: Cut) -> None:
    """OutOfBandError where chatter would be at the end of the FRFs' lines, or beyond."""
    found = curves(
        frf.frequency_hz, frf.receptance.transpose(2, 0, 1),
        mean_matrix(cut, Coefficients.of(cut)),
    )  # fmt: skip
    ends = frf.frequency_hz[0], frf.frequency_hz[-1]
    if not np.isfinite(found.floor_m):
        where = "at no frequency within them"
    elif found.floor_hz in ends:
        where = "at their very end or beyond"
    else:
        return
    raise OutOfBandError(
        f"{frf.name}: the FRFs reach from {ends[0]:g} to {ends[1]:g} Hz and the cut would chatter "
        f"{where}; measure over the band of the modes that chatter."
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
