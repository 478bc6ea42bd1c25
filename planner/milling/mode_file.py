"""A TOML file with [[mode]] tables: the structure at the cutter as an engineer states it."""

from pathlib import Path

import msgspec
import numpy as np

from planner.errors import InputError
from planner.milling.cut import UNIT
from planner.milling.cutter_modes import CutterModes, real_modes
from planner.toml_file import load_toml


class StatedMode(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A mode: undamped natural frequency, damping, modal mass, and how well each is known.

    `direction` is the unit vector along which it moves and is driven.
    """

    frequency_hz: float
    damping_ratio: float
    mass_kg: float
    direction: tuple[float, float, float]
    frequency_sd_hz: float = 0.0
    damping_sd: float = 0.0
    mass_sd_percent: float = 0.0


class ModeFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole file."""

    mode: list[StatedMode]

    @property
    def modes(self) -> CutterModes:
        """As poles and shapes, in the frame of the file."""
        return real_modes(
            np.array([m.frequency_hz for m in self.mode]),
            np.array([m.damping_ratio for m in self.mode]),
            np.array([m.mass_kg for m in self.mode]),
            np.array([m.direction for m in self.mode]),
        )

    @property
    def relative_sds(self) -> np.ndarray:
        """(n, 3) of frequency, damping and residue, whose size falls as the mass rises."""
        return np.array([
            [m.frequency_sd_hz / m.frequency_hz, m.damping_sd / m.damping_ratio,
             m.mass_sd_percent / 100] for m in self.mode
        ])  # fmt: skip


def load_mode_file(path: Path) -> ModeFile:
    """Read and check a file of modes; InputError with one sentence where it is wrong."""
    found = load_toml(path, ModeFile, "file of [[mode]] tables")
    if not found.mode:
        raise InputError(f"{path} holds no [[mode]]; state at least one.")
    for i, mode in enumerate(found.mode, 1):
        _check(mode, f"{path}: [[mode]] {i}")
    return found


def _check(mode: StatedMode, where: str) -> None:
    limits = [
        ("frequency_hz", mode.frequency_hz, 1e-3, 1e6),
        ("damping_ratio", mode.damping_ratio, 1e-7, 0.999),
        ("mass_kg", mode.mass_kg, 1e-9, 1e9),
        ("frequency_sd_hz", mode.frequency_sd_hz, 0.0, mode.frequency_hz),
        ("damping_sd", mode.damping_sd, 0.0, 1.0),
        ("mass_sd_percent", mode.mass_sd_percent, 0.0, 100.0),
    ]
    for name, value, low, high in limits:
        if not low <= value <= high:
            raise InputError(
                f"{where}: {name} is {value}; it must lie between {low:g} and {high:g}."
            )
    if not abs(np.linalg.norm(mode.direction) - 1) < UNIT:
        raise InputError(f"{where}: direction is not of length 1; give a unit vector.")
