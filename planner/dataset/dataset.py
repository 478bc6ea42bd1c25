"""Recordings read, screened and in order: what every analysis of several poses is given."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from planner.dataset.measure import MeasuredPose
from planner.dataset.store import Store, user_store
from planner.dataset.visits import PoseEntry, Recording, Visit, recordings_in, unlisted_folders
from planner.errors import RefusedError
from planner.frf.estimator import estimate
from planner.frf.frf import Frf
from planner.modal.modes import ModalModel
from planner.progress import ProgressCallback, no_progress
from planner.recording.force_levels import level_of, levels
from planner.recording.points import SENSOR, TCP, together
from planner.recording.records import Hit

# Rate (1/s) of an exponential window that is laid over all records: decays that they cut off are
# then too small to matter, and FRFs hold at s = iω + rate.
LAID = 2.0


@dataclass(frozen=True, eq=False)
class Dataset:
    """Poses that were hit, in the order of recording; made by `read`, `of` or `of_visits`.

    It never changes. FRFs and modes are computed when they are first asked for. n counts
    the poses with an FRF, v the visits with a hit. `refused` names the files that could not be
    used, each with its reason; `window_rate_1_s` is that of an exponential window that all
    channels carry.
    """

    entries: tuple[PoseEntry, ...]  # also those without an FRF
    recordings: tuple[Recording, ...]  # that the entries are of
    band_hz: tuple[float, float]
    window_rate_1_s: float = 0.0
    refused: tuple[tuple[str, str], ...] = ()
    remarks: tuple[str, ...] = ()
    simulated: bool = False
    given: tuple[Visit, ...] = ()  # that the entries are of, where there are no recordings

    @classmethod
    def read(
        cls,
        folder: Path | str,
        robot: Any,
        band_hz: tuple[float, float] | None = None,
        *,
        window_rate_1_s: float = 0.0,
        progress: ProgressCallback = no_progress,
        store: Store | None = None,
    ) -> "Dataset":
        """Read and screen all hits of a folder as the analyser wrote it.

        Args:
            folder: Holds recordings.csv and the files that it names, or subfolders that do; or
                the table itself.
            robot: A `Robot`: whose joints the table has, and where it may be hit and heard.
            band_hz: Which the hits have to excite, and in which FRFs are wanted; by default that of
                robot.toml.
            window_rate_1_s: Of an exponential window that the analyser laid over all channels.
            progress: Is told which pose is read, and which share (0 to 1) of them is.
            store: Where FRFs and modes are looked up and kept; by default the user's.

        Raises:
            InputError: The table is wrong.
            RefusedError: No pose has a hit that can be used.
        """
        listed = recordings_in(Path(folder), robot.joints, robot.points)
        found = cls.of(
            listed,
            band_hz or robot.config.band_hz,
            window_rate_1_s=window_rate_1_s,
            progress=progress,
            store=store,
            name=str(folder),
        )
        return replace(found, remarks=(*unlisted_folders(Path(folder), listed), *found.remarks))

    @classmethod
    def of(
        cls,
        recordings: Sequence[Recording],
        band_hz: tuple[float, float],
        *,
        window_rate_1_s: float = 0.0,
        progress: ProgressCallback = no_progress,
        store: Store | None = None,
        name: str = "The recordings",
    ) -> "Dataset":
        """As `read`, of files wherever they are, in the order of recording.

        `name` is what messages call them. Raises as `read` does.
        """
        store = store or user_store()
        by_pose: dict[str, list[Recording]] = {}
        for recording in recordings:
            by_pose.setdefault(recording.pose, []).append(recording)
        entries = []
        for number, (pose, group) in enumerate(by_pose.items()):
            progress(f"reading pose {pose}", number / len(by_pose))
            sources = tuple(recording.source for recording in group)
            measured = MeasuredPose(sources, band_hz, window_rate_1_s=window_rate_1_s, store=store)
            _ = measured.averaged
            q = np.mean([recording.q for recording in group], axis=0)
            entries.append(PoseEntry(pose, q, measured))
        verdicts = [v for entry in entries for v in entry.measured.verdicts]
        refused = tuple(one for verdict in verdicts for one in verdict.refused)
        remarks = tuple(
            f"Pose {entry.pose} is left out: {entry.measured.averaged.remarks[0]}"
            for entry in entries
            if entry.measured.whole is None
        )
        if len(remarks) == len(entries):
            reason = refused[0][1] if refused else "".join(remarks[:1])
            raise RefusedError(f"{name}: no pose has a hit that can be used: {reason}")
        return cls(
            tuple(entries),
            tuple(recordings),
            band_hz,
            window_rate_1_s,
            refused,
            remarks,
            any(v.simulated for v in verdicts),
        )

    @classmethod
    def of_visits(
        cls, visits: Iterable[Visit], band_hz: tuple[float, float], window_rate_1_s: float = 0.0
    ) -> "Dataset":
        """Of good hits that are at hand already; each visit is an entry of its own."""
        return cls((), (), band_hz).corrected(visits, window_rate_1_s)

    def corrected(self, visits: Iterable[Visit], window_rate_1_s: float | None = None) -> "Dataset":
        """The same with other hits: those that a screen has corrected, or some of them only.

        Each visit is an entry of its own then, with all its hits: what disagreed may agree now.
        """
        rate = self.window_rate_1_s if window_rate_1_s is None else window_rate_1_s
        given = tuple(visits)
        return replace(
            self,
            entries=tuple(
                PoseEntry(v.pose, v.q, MeasuredPose((), self.band_hz, "h1", rate, v.hits))
                for v in given
            ),
            recordings=(),
            given=given,
            window_rate_1_s=rate,
        )

    def __repr__(self) -> str:
        low, high = self.band_hz
        poses, visits = len(self.entries), len(self.given or self._runs)
        return f"Dataset({poses} poses, {visits} visits, {low:g} to {high:g} Hz)"

    # -- by pose -------------------------------------------------------------------------------

    @cached_property
    def measured(self) -> tuple[PoseEntry, ...]:
        """The n entries with an FRF."""
        return tuple(entry for entry in self.entries if entry.measured.whole is not None)

    @property
    def poses(self) -> tuple[str, ...]:
        """Names of the n poses."""
        return tuple(entry.pose for entry in self.measured)

    @property
    def q(self) -> np.ndarray:
        """Mean readback (n, dof) in rad."""
        return np.array([entry.q for entry in self.measured])

    @property
    def frfs(self) -> tuple[Frf, ...]:
        """Of each pose, all its visits and force levels together, at all points."""
        return tuple(frf for entry in self.measured if (frf := entry.measured.whole))

    @property
    def ended_frfs(self) -> tuple[Frf, ...]:
        """The same, weighted, under exponential windows by which decays are over at the end."""
        return tuple(frf for entry in self.measured if (frf := entry.measured.ended_frf))

    @property
    def one_hit_frfs(self) -> tuple[Frf, ...]:
        """The same, each of one hit in the middle of all (`MeasuredPose.one_hit_frf`)."""
        return tuple(frf for entry in self.measured if (frf := entry.measured.one_hit_frf))

    @property
    def modes(self) -> tuple[ModalModel | None, ...]:
        """Of each pose; None where no mode was found."""
        return tuple(entry.measured.modal for entry in self.measured)

    # -- by visit ------------------------------------------------------------------------------

    @cached_property
    def _runs(self) -> list[list[Recording]]:
        """Neighbouring recordings of one pose are of one visit."""
        return [list(run) for _, run in groupby(self.recordings, key=lambda one: one.pose)]

    @cached_property
    def visits(self) -> tuple[Visit, ...]:
        """The v visits with a hit; a pose that was returned to has several.

        None of a pose whose FRFs were exported.
        """
        found, last = [*self.given], max(len(self._runs) - 1, 1)
        files = {e.pose: iter(e.measured.files.hits) for e in self.entries}
        for place, run in enumerate(self._runs):
            hits = tuple(hit for one in run for hit in next(files[one.pose]))
            q = np.mean([one.q for one in run], axis=0)
            found.append(Visit(run[0].pose, q, place / last, hits))
        return tuple(visit for visit in found if visit.hits)

    def frf(self, hits: tuple[Hit, ...]) -> Frf:
        """FRF of some hits of a visit, with an exponential window of rate LAID over them."""
        return estimate(hits, self.band_hz, "h1", LAID, window_rate_1_s=self.window_rate_1_s)

    # -- by point ------------------------------------------------------------------------------

    @cached_property
    def sensors(self) -> tuple[str, ...]:
        """Names of all points where a sensor was, in the order of recording."""
        return together([frf.layout for frf in self.frfs]).sensors

    def channels_of(self, sensor: str, hit_point: str | None = None) -> "Dataset":
        """Hits as one triaxial sensor has them: those that it heard, of one hit point or of all."""
        some = []
        for visit in self.visits:
            own = (h for h in visit.hits if hit_point is None or h.hit_point == hit_point)
            hits = tuple(one for hit in own if (one := hit.channels_of(sensor)) is not None)
            if hits:
                some.append(replace(visit, hits=hits))
        return self.corrected(some)

    @cached_property
    def most_heard(self) -> "Dataset":
        """Hits at one point as one triaxial sensor has them, both those of most visits.

        The tool's, where it is among these; all, where there is nothing else.
        """
        count: Counter[tuple[str, str]] = Counter()
        for visit in self.visits:
            count.update({(h.hit_point, s) for h in visit.hits for s in h.layout.sensors
                          if h.channels_of(s) is not None})  # fmt: skip
        if set(count) <= {(TCP, SENSOR)} and self.sensors in ((SENSOR,), ()):
            return self
        if not count:
            return self.corrected(())
        most = max(count.values())
        ends = [pair for pair, visits in count.items() if visits == most]
        hit_point, sensor = (TCP, SENSOR) if (TCP, SENSOR) in ends else ends[0]
        return self.channels_of(sensor, hit_point)

    # -- by force level ------------------------------------------------------------------------

    @cached_property
    def _by_level(self) -> list[np.ndarray]:
        return levels(np.sort([hit.pulse.peak_n for visit in self.visits for hit in visit.hits]))

    @cached_property
    def level_n(self) -> np.ndarray:
        """Peak forces (levels,) in N, weakest first: the same for all visits."""
        return np.array(
            [float(np.exp(np.mean(np.log(group)))) for group in self._by_level if len(group)]
        )

    def level(self, hit: Hit) -> int:
        """Which of `level_n` a hit belongs to."""
        return int(level_of(np.array(hit.pulse.peak_n), self._by_level))
