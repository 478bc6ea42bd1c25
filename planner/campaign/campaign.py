"""The campaign: the only thing with state, and its state is a fold over its log."""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from planner.campaign import events, store
from planner.campaign.config import load_campaign_config
from planner.campaign.journal import remove_parts
from planner.campaign.read_only import ReadOnlyCampaign
from planner.campaign.undo import last_acts, last_undone
from planner.dataset.screened_files import Source
from planner.errors import InputError
from planner.progress import ProgressCallback, no_progress
from planner.version import __version__

if TYPE_CHECKING:
    from planner.campaign.importing import ImportReport


class Campaign(ReadOnlyCampaign):
    """A campaign folder, opened. Reads never write; every act is on the disk when it returns."""

    @classmethod
    def new(
        cls, directory: Path | str, robot_toml: Path | str, campaign_toml: Path | str | None
    ) -> "Campaign":
        """Start a campaign: copy robot folder and decisions in, write the first event.

        Raises InputError if the folder is in use or any input is wrong.
        """
        own = None if campaign_toml is None else Path(campaign_toml)
        store.create_folder(Path(directory), Path(robot_toml), own, _first_event)
        return cls(directory)

    def next(self, count: int = 1, acquisition: str | None = None) -> tuple[events.Proposal, ...]:
        """The next poses to measure; the same ones until something changes.

        Raises NoPoseLeftError when no reachable pose is left.
        """
        from threadpoolctl import threadpool_limits

        from planner.campaign.proposals import propose

        with self._acting(), threadpool_limits(1):
            state = self.state
            name = acquisition or self.cell.config.acquisition.name
            same = not state.stale and state.proposed_by == name
            if same and len(state.open) >= count:
                return tuple(state.proposals[pose] for pose in state.open[:count])
            proposals = propose(self.model, state, count, name)
            self.append(events.Proposed(name, count, proposals))
            return proposals

    def import_paths(
        self,
        paths: Sequence[Path | str],
        pose: str | None = None,
        progress: ProgressCallback = no_progress,
        from_names: bool = False,
    ) -> "tuple[ImportReport, ...]":
        """Import hits, one report per pose, in recording order.

        With `from_names` the names of files say where their FRFs were felt and hit.
        Files that the engineer refused are imported only where `paths` names them themselves.
        Hits far from what the model is sure of are held until `confirm`, `move` or `refuse_held`.
        Raises InputError, before anything is stored, if it is not clear what or where they are.
        """
        from threadpoolctl import threadpool_limits

        from planner.campaign.importing import import_paths

        with self._acting(), threadpool_limits(1):
            return import_paths(self, tuple(map(Path, paths)), pose, progress, from_names)

    def refuse(
        self,
        pose: str,
        paths: tuple[Path, ...],
        reasons: Mapping[Path, str] | None = None,
        stated: Mapping[Path, Source] | None = None,
    ) -> None:
        """Refuse files that wait at a pose: they are kept, and not imported unless named.

        `reasons` are what was found wrong with some of them, `stated` what a table says of some:
        those are judged again once it says something else.
        """
        from planner.campaign.imported_files import record_of

        with self._acting():
            hits = []
            for path in paths:
                given = (stated or {}).get(path, Source(path, ""))
                kept = store.store_recording(self.directory, path)
                why = (reasons or {}).get(path)
                said = f"{why} ({events.REFUSED})" if why else events.REFUSED
                hits.append(record_of(replace(given, name=str(path), path=kept), said))
            if hits:
                self.append(events.Refused(pose, tuple(hits)))

    def confirm(self, pose: str) -> "ImportReport":
        """Held hits are from their pose indeed, or those of a withdrawn one good: they are used."""
        from planner.campaign.importing import ImportReport

        started = time.perf_counter()
        with self._acting():
            known, before = self.state.measurements.get(pose), self.model
            if known is None or not known.withdrawn:
                self.held_import(pose)
            self.append(events.Confirmed(pose))
            found = self.state.measurements[pose]
            return ImportReport(
                pose, found, before, self.model, found.accepted, remarks=self.model.remarks,
                refit_seconds=time.perf_counter() - started,
            )  # fmt: skip

    def move(self, pose: str, other: str) -> "ImportReport":
        """The held hits of a pose are from another one: import them there."""
        from planner.campaign.imported_files import ImportedFiles
        from planner.campaign.importing import import_pose, readback_of

        with self._acting():
            _, event = self.held_import(pose)
            sources = tuple(self.recordings.source(hit) for hit in event.hits)
            delivery = ImportedFiles(other, None, sources)
            joints_deg = readback_of(self.cell, self.state, delivery)
            if other in self.state.held:
                raise InputError(f"Hits of {other} wait for an answer too; answer that first.")
            return import_pose(self, delivery, joints_deg, frozenset(s.path for s in sources))

    def refuse_held(self, pose: str, reason: str = events.REFUSED) -> None:
        """The held hits of a pose are set aside, as if they had been refused when they came."""
        with self._acting():
            entry, event = self.held_import(pose)
            asked = event.question
            why = f"{reason}; held before: {asked.text}" if asked else reason
            hits = (
                msgspec.structs.replace(h, accepted=False, reason=h.reason or why)
                for h in event.hits
            )
            self.append(events.Refused(pose, tuple(hits), instead=(entry.seq,)))

    def withdraw(self, pose: str, reason: str = "") -> None:
        """Set a measured pose aside, or held hits; the recordings stay."""
        if pose in self.state.held:
            return self.refuse_held(pose, reason or events.REFUSED)
        with self._acting():
            measurement = self.state.hit_at(pose)
            if measurement is None or measurement.withdrawn:
                raise InputError(f"Pose {pose} is not among the measured ones; see planner status.")
            self.append(events.Withdrawn(pose, reason))

    def skip(self, pose: str, reason: str = "", neighbours: bool = False) -> None:
        """A proposed pose shall not be measured: never offered again, nor its `neighbours`."""
        with self._acting():
            if pose not in self.state.open:
                raise InputError(f"Pose {pose} is not an open proposal; see planner status.")
            self.append(events.Skipped(pose, reason, neighbours))

    def star(self, pose: str) -> None:
        """Mark a pose as worth a second look."""
        with self._acting():
            if pose not in self.state.measurements and pose not in self.state.proposals:
                raise InputError(f"Pose {pose} is not known; see planner status.")
            self.append(events.Starred(pose))

    def undo(self, decisions_only: bool = False) -> tuple[events.Entry, ...]:
        """Take back the last act (proposal, import, answer, refusal, withdrawal, skip, star).

        With `decisions_only` the last that is no proposal; those that followed it go with it and
        are given after it.
        """
        with self._acting():
            acts = last_acts(self.entries, decisions_only)
            if not acts:
                raise InputError(f"{self.directory} holds no act that could be taken back.")
            self.append(events.Undone(tuple(entry.seq for entry in acts)))
            return acts

    def redo(self) -> tuple[events.Entry, ...]:
        """Let hold again what `undo` took back last, while nothing else was decided since.

        The entries that hold again; proposals made since are taken back, as they followed.
        """
        with self._acting():
            undone, since = last_undone(self.entries)
            if undone is None:
                raise InputError(
                    f"{self.directory}: the last act was no undo; only an undo that nothing else "
                    f"followed can be done again."
                )
            assert isinstance(undone.event, events.Undone)
            self.append(events.Undone(tuple(entry.seq for entry in (*since, undone))))
            return tuple(self.entries[act - 1] for act in undone.event.acts)

    def show(self, pose: str, files: Sequence[str], at: str = "") -> None:
        """Files (sha256) are of a pose, as they were shown there: they never move on by themselves.

        With `at` that is a guess, and they came there. What was said of a file before holds.
        """
        with self._acting():
            if new := tuple(file for file in files if file not in self.state.shown):
                self.append(events.FilesShown(pose, new, at))

    def place(self, pose: str, files: Sequence[str]) -> None:
        """The engineer says that files (sha256) shown elsewhere were hit at this pose."""
        with self._acting():
            self.append(events.FilesPlaced(pose, tuple(files)))

    def holding(self):
        """A context in which nobody else can act in this campaign; InputError names who does."""
        return self._journal.holding(wait_s=1.0, session=True)

    def held_import(self, pose: str) -> tuple[events.Entry, events.Imported]:
        """The import that is held at a pose; InputError if none is."""
        if pose not in self.state.held:
            raise InputError(f"No hits of pose {pose} wait for an answer; see planner status.")
        found = [
            (e, e.event)
            for e in self.entries
            if isinstance(e.event, events.Imported) and e.event.pose == pose and e.event.question
        ]
        return found[-1]

    def append(self, event: events.AnyEvent) -> events.Entry:
        """Write one event, within an act."""
        return self._journal.append(event)

    # -- inside --------------------------------------------------------------------------------

    @contextmanager
    def _acting(self) -> Iterator[None]:
        """The campaign's lock, its log read afresh, changes made by hand to its files followed."""
        from planner.campaign.cell import refuse_errors

        with self._journal.writing():
            remove_parts(self.directory / store.RECORDINGS)
            configured, logged = self._configured(), self.state.configured
            assert logged is not None
            if (configured.config, configured.robot) != (logged.config, logged.robot):
                refuse_errors(self.cell.examined)  # before it is believed
                store.keep_robot_files(self.directory, configured.robot)
                self.append(configured)
            yield


def _first_event(directory: Path) -> events.Configured:
    """What begins a campaign's log, once robot and workspace were held against each other."""
    from planner.campaign.cell import Cell, refuse_errors

    config = load_campaign_config(directory / store.CONFIG)
    cell = Cell.load(directory / config.robot, config)
    refuse_errors(cell.examined)
    hashes = store.robot_hashes(directory)
    store.keep_robot_files(directory, hashes)
    return events.Configured(config, hashes, __version__, cell.robot.joints.declared)
