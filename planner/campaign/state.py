"""The state of a campaign: a pure fold over its events."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec

from planner.campaign import events
from planner.campaign.events import AnyEvent, Entry, HitRecord, MeasuredMode, Proposal, Question
from planner.modal.modes import Homogeneity


@dataclass(frozen=True)
class Measurement:
    """One measured pose: readback angles, all its hits, modes of the accepted ones."""

    pose: str
    joints_deg: tuple[float, ...]
    hits: tuple[HitRecord, ...]
    modes: tuple[MeasuredMode, ...]
    remarks: tuple[str, ...] = ()
    amplitude: Homogeneity | None = None
    withdrawn: bool = False
    time: str = ""
    question: Question | None = None  # open while it is held, else answered

    @property
    def accepted(self) -> tuple[HitRecord, ...]:
        """Hits in use."""
        return tuple(hit for hit in self.hits if hit.accepted)

    @property
    def axes(self) -> frozenset[str]:
        """Along which axes it was hit, of hits in use; none of FRFs, which do not say."""
        return frozenset(hit.hit[-1] for hit in self.accepted if hit.hit)

    @property
    def refused(self) -> tuple[HitRecord, ...]:
        """Refused hits whose file was not accepted since, from whichever folder."""
        return tuple(h for h in self.hits if not h.accepted and not self.replaced(h))

    def replaced(self, hit: HitRecord) -> bool:
        """Whether a file of the same name, along the same axis where it says one, is in use."""

        def named(h: HitRecord) -> tuple[str, int, str | None]:
            return Path(h.file).name, h.part, h.response

        axes = {h.hit for h in self.accepted if named(h) == named(hit)}
        return bool(axes) and (hit.hit is None or hit.hit in axes)

    @property
    def unhit(self) -> bool:
        """Whether every hit was refused, so that nothing is known of the pose."""
        return not self.modes and not self.accepted

    @property
    def simulated(self) -> bool:
        """Whether any hit is labelled as simulated."""
        return any(hit.simulated for hit in self.hits)


@dataclass(frozen=True)
class CampaignState:
    """Everything the log says; a value."""

    configured: events.Configured | None = None
    proposals: dict[str, Proposal] = field(default_factory=dict)  # all ever made, undone ones too
    open: tuple[str, ...] = ()  # proposed and not yet measured, skipped or superseded
    proposed_by: str = ""  # acquisition that made the open proposals
    # The model changed since the open proposals were made, by more than late hits of a pose before.
    stale: bool = True
    measurements: dict[str, Measurement] = field(default_factory=dict)
    held: dict[str, Measurement] = field(default_factory=dict)  # until their question is answered
    refused: dict[str, tuple[str, HitRecord]] = field(default_factory=dict)  # by sha256: pose, hit
    shown: dict[str, str] = field(default_factory=dict)  # by sha256: the pose that it is of
    guessed: dict[str, str] = field(default_factory=dict)  # where those came that are guessed
    skipped: dict[str, str] = field(default_factory=dict)
    avoided: frozenset[str] = frozenset()  # of these, those whose neighbours are not offered either
    starred: frozenset[str] = frozenset()
    doubt: tuple[str, str] | None = None  # pose to hit again, and the one whose hits hint at drift
    proposals_made: int = 0  # names given, undone ones too: none is given to another pose
    events: int = 0
    model_version: int = 0  # sequence number of the last event that changed the model

    @property
    def used(self) -> tuple[Measurement, ...]:
        """Measurements that the model uses, in the order of their first import."""
        return tuple(m for m in self.measurements.values() if m.modes and not m.withdrawn)

    @property
    def measured(self) -> tuple[Measurement, ...]:
        """Poses of which something was accepted, used or not."""
        return tuple(m for m in self.measurements.values() if not m.unhit)

    def hit_at(self, pose: str) -> Measurement | None:
        """What was measured at a pose; None too where every hit there was refused."""
        known = self.measurements.get(pose)
        return None if known is None or known.unhit else known

    def came(self, digest: str, pose: str) -> str:
        """The pose that a file (sha256) is of, as seen from `pose`; that where nothing is known.

        What is only guessed to be of it is not taken for its own: there it is of where it came.
        """
        known = self.shown.get(digest, pose)
        return self.guessed.get(digest, known) if known == pose else known

    @property
    def in_use(self) -> dict[str, tuple[str, HitRecord]]:
        """All hits that are in use, or held, by sha256: pose, hit."""
        held = [(pose, hit) for pose, m in self.held.items() for hit in m.hits]
        used = (m for m in self.measurements.values() if not m.withdrawn)
        every = held + [(m.pose, hit) for m in used for hit in m.accepted]
        return {hit.sha256: (pose, hit) for pose, hit in every}

    def unchanged_by(self, event: AnyEvent) -> bool:
        """Whether an act changes neither the model nor what is proposed."""
        if isinstance(event, events.Imported):
            return event.question is not None or event.unhit
        return isinstance(
            event, events.Starred | events.Refused | events.FilesShown | events.FilesPlaced
        )

    @property
    def simulated(self) -> bool:
        """Whether any recording is labelled as simulated."""
        return any(m.simulated for m in self.recorded)

    @property
    def recorded(self) -> tuple[Measurement, ...]:
        """All that was imported, used or not, and what is held."""
        return (*self.measurements.values(), *self.held.values())


def fold(entries: Iterable[Entry]) -> CampaignState:
    """The state after the given entries (seq 1, 2, …)."""
    entries = tuple(entries)
    undone = taken_back(entries)
    state = CampaignState()
    for entry in entries:
        if isinstance(entry.event, events.Proposed):
            made = {p.pose: p for p in entry.event.proposals}
            # A pose that is proposed again keeps its name.
            numbers = [int(pose[1:]) for pose in made if pose[1:].isdecimal()]
            count = max([state.proposals_made, *numbers])
            state = replace(state, proposals_made=count, proposals=state.proposals | made)
        if isinstance(entry.event, events.Undone):
            if not all(map(state.unchanged_by, _acts_of(entries, entry.event))):
                state = replace(state, model_version=entry.seq)
        elif entry.seq not in undone:
            state = _apply(state, entry.event, entry)
        state = replace(state, events=entry.seq)
    return state


def without_entries(entries: Sequence[Entry], acts: tuple[int, ...]) -> CampaignState:
    """The state as if the acts of these numbers were taken back."""
    return fold([*entries, Entry(len(entries) + 1, "", events.Undone(acts))] if acts else entries)


def taken_back(entries: Sequence[Entry]) -> frozenset[int]:
    """Numbers of the entries that do not hold; an Undone that was itself undone takes nothing."""
    found: set[int] = set()
    for entry in reversed(entries):
        event = entry.event
        if entry.seq in found:
            continue
        if isinstance(event, events.Undone):
            found.update(event.acts)
        elif isinstance(event, events.Imported | events.Refused):
            found.update(event.instead)
    return frozenset(found)


def _acts_of(entries: Sequence[Entry], event: AnyEvent) -> Iterator[AnyEvent]:
    """What an Undone is about in the end, an undo of an undo too."""
    if not isinstance(event, events.Undone):
        yield event
        return
    for act in event.acts:
        yield from _acts_of(entries, entries[act - 1].event)


def _apply(state: CampaignState, event: AnyEvent, entry: Entry) -> CampaignState:
    changed = replace(state, stale=True, model_version=entry.seq)
    match event:
        case events.Configured():
            return replace(changed, configured=event)
        case events.Proposed():
            open_ = tuple(p.pose for p in event.proposals)
            return replace(state, open=open_, proposed_by=event.acquisition, stale=False)
        case events.Imported():
            return _imported(state, changed, event, entry)
        case events.Confirmed():
            held = {pose: m for pose, m in state.held.items() if pose != event.pose}
            known = state.held.get(event.pose) or state.measurements[event.pose]
            measurements = {**state.measurements, event.pose: replace(known, withdrawn=False)}
            return replace(changed, measurements=measurements, held=held)
        case events.Refused():
            hits = {hit.sha256: (event.pose, hit) for hit in event.hits}
            return replace(state, refused={**state.refused, **hits})
        case events.Withdrawn():
            measurement = replace(state.measurements[event.pose], withdrawn=True)
            measurements = {**state.measurements, event.pose: measurement}
            return replace(changed, measurements=measurements, doubt=_doubt(state, event.pose))
        case events.Skipped():
            left = tuple(pose for pose in state.open if pose != event.pose)
            avoided = state.avoided | ({event.pose} if event.neighbours else set())
            skipped = {**state.skipped, event.pose: event.reason}
            doubt = _doubt(state, event.pose)
            return replace(changed, open=left, skipped=skipped, avoided=avoided, doubt=doubt)
        case events.FilesShown():
            new = [file for file in event.files if file not in state.shown]
            guessed = state.guessed | (dict.fromkeys(new, event.at) if event.at else {})
            shown = state.shown | dict.fromkeys(new, event.pose)
            return replace(state, shown=shown, guessed=guessed)
        case events.FilesPlaced():
            guessed = {file: at for file, at in state.guessed.items() if file not in event.files}
            shown = state.shown | dict.fromkeys(event.files, event.pose)
            return replace(state, shown=shown, guessed=guessed)
        case events.Starred():
            return replace(state, starred=state.starred | {event.pose})
    return state


def _imported(
    state: CampaignState, changed: CampaignState, event: events.Imported, entry: Entry
) -> CampaignState:
    came = {hit.sha256 for hit in event.hits}
    # Refused hits of files that come again are judged again.
    earlier = {
        pose: replace(m, hits=tuple(h for h in m.hits if h.accepted or h.sha256 not in came))
        for pose, m in state.measurements.items()
    }
    before = without(earlier.get(event.pose), event.replaced)
    hits = (*(before.hits if before else ()), *event.hits)
    when, asked = (before.time, before.question) if before else (entry.time, None)
    measurement = Measurement(
        event.pose, event.joints_deg, hits, event.modes, event.remarks, event.amplitude,
        time=when, question=event.question or asked,
    )  # fmt: skip
    left = state.open
    if measurement.modes:
        left = tuple(pose for pose in state.open if pose != event.pose)
    refused = {digest: hit for digest, hit in state.refused.items() if digest not in came}
    if event.question is not None:
        held = {**state.held, event.pose: measurement}
        return replace(state, open=left, refused=refused, held=held)
    measurements = {**earlier, event.pose: measurement}
    if state.unchanged_by(event):
        return replace(state, refused=refused, measurements=measurements)
    doubt = (event.again, event.pose) if event.again else _doubt(state, event.pose)
    late = state.hit_at(event.pose) is not None and event.pose not in state.open
    stale = state.stale if late and doubt == state.doubt else True
    return replace(
        changed, open=left, refused=refused, measurements=measurements, doubt=doubt, stale=stale
    )


def without(known: Measurement | None, replaced: Sequence[str]) -> Measurement | None:
    """A measurement without files (sha256) that newer ones take the place of."""
    if known is None or not replaced:
        return known
    hits = tuple(
        hit if hit.sha256 not in replaced
        else msgspec.structs.replace(hit, accepted=False, reason=hit.replaced)
        for hit in known.hits
    )  # fmt: skip
    return replace(known, hits=hits)


def _doubt(state: CampaignState, pose: str) -> tuple[str, str] | None:
    """What is left of a doubt after an act at a pose: none where it was about that."""
    return None if state.doubt is not None and pose in state.doubt else state.doubt
