"""Recordings of several poses as identification and diagnosis use them, read once asked for.

A thin stand-in over the readers that are there: the FRFs of either use, and the hits themselves.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from planner.dataset.recorded import Recorded, read_recorded
from planner.dataset.visits import Recorded as Visits
from planner.dataset.visits import read_visits
from planner.dataset.windowed import read_ended
from planner.errors import RefusedError
from planner.frf.frf import Frf


@dataclass(frozen=True, eq=False)
class Dataset:
    """A folder with recordings.csv, the robot's joints and the band in which hits must excite.

    `window_rate_1_s` is that of an exponential window that the analyser laid over all channels.
    """

    folder: Path
    joint_names: tuple[str, ...]
    band_hz: tuple[float, float]
    window_rate_1_s: float = 0.0
    progress: Callable[[str], None] | None = None

    @classmethod
    def read(
        cls,
        folder: Path | str,
        joint_names: tuple[str, ...],
        band_hz: tuple[float, float],
        *,
        window_rate_1_s: float = 0.0,
        progress: Callable[[str], None] | None = None,
    ) -> "Dataset":
        """Recordings of a folder; `progress` is told which pose is read.

        Errors are raised where the recordings are first used: InputError where the table is
        wrong, RefusedError where no pose has a hit that can be used.
        """
        return cls(Path(folder), tuple(joint_names), band_hz, window_rate_1_s, progress)

    @cached_property
    def averaged(self) -> Recorded:
        """FRFs of whole records, for identification."""
        return read_recorded(*self._where)

    @cached_property
    def ended(self) -> Recorded:
        """FRFs under a window that ends their decays, for diagnosis."""
        return read_ended(*self._where)

    @cached_property
    def visits(self) -> Visits | None:
        """The hits themselves; None where there are only FRFs, or a window is stated."""
        try:
            visits = read_visits(self.folder, self.joint_names, self.band_hz)
        except RefusedError:
            return None
        return None if self.window_rate_1_s else visits

    @property
    def poses(self) -> tuple[str, ...]:
        """Names of the n poses with an FRF, in the order of recording."""
        return self.averaged.poses

    @property
    def q(self) -> np.ndarray:
        """Joint angles (n, dof) in rad."""
        return self.averaged.q

    @property
    def frfs(self) -> tuple[Frf, ...]:
        """Of each pose."""
        return self.averaged.frfs

    @property
    def refused(self) -> tuple[tuple[str, str], ...]:
        """Files that could not be used, each with its reason."""
        return self.averaged.refused

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the engineer should mind."""
        return self.averaged.remarks

    @property
    def simulated(self) -> bool:
        """Whether any recording is labelled as simulated."""
        return self.averaged.simulated

    @property
    def _where(self) -> tuple:
        tell = self.progress or (lambda text: None)
        return self.folder, self.joint_names, self.band_hz, self.window_rate_1_s, tell
