"""What can happen in a campaign: one immutable record per line of the log."""

from pathlib import Path

import msgspec

from planner.campaign.config import CampaignConfig
from planner.modal.modes import LEAST_PROBABILITY, Homogeneity

REFUSED = "refused by the engineer"  # the reason where none is given
REPLACED = "replaced by a newer"


class Event(msgspec.Struct, frozen=True, tag_field="kind"):
    """Base of every entry of the log."""

    @property
    def kind(self) -> str:
        """What it is, as the log has it."""
        return str(self.__struct_config__.tag)


class Configured(Event, frozen=True, tag="configured"):
    """The campaign was started, or its campaign.toml or robot folder was changed by hand.

    `config` is campaign.toml; `robot` maps each file of the robot folder to its sha256.
    `joint_units` are those of all `joints_deg` that follow, "deg" or "mm" of each joint; unset
    where all are degrees.
    """

    config: CampaignConfig
    robot: dict[str, str]
    planner: str
    joint_units: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET


class Proposal(msgspec.Struct, frozen=True):
    """A pose to measure: joint setpoint, tcp position, score of the acquisition, why.

    `score` is None where the acquisition, a space-filling design, gives none. `hits` are the tcp
    axes to hit along, `minutes` what getting there and hitting takes.
    """

    pose: str
    joints_deg: tuple[float, ...]
    position_m: tuple[float, float, float]
    score: float | None
    reason: str
    hits: tuple[str, ...] = ("x", "y", "z")
    minutes: float | None = None


class Proposed(Event, frozen=True, tag="proposed"):
    """`count` poses were asked for; these replace the poses proposed before and not yet hit."""

    acquisition: str
    count: int
    proposals: tuple[Proposal, ...]


class HitRecord(msgspec.Struct, frozen=True):
    """One file as it was imported; the file itself is kept under its sha256.

    `reason` says why it was refused; empty for an accepted hit. `part` is which of the hits in the
    file it is, from 1; 0: the file holds no other.
    """

    file: str
    sha256: str
    suffix: str
    hit: str | None = None
    repeat: int | None = None
    accepted: bool = True
    reason: str = ""
    simulated: bool = False
    hit_point: str = ""  # as the table of recordings named it, "" where it did not
    response_points: tuple[str, ...] = ()
    part: int = 0
    response: str | None = None  # signed axis of an FRF's response, as the table named it
    from_name: bool = False  # FRFs' places are from the file's name

    @property
    def whole_name(self) -> str:
        """The file's name, without which of its hits is meant."""
        return self.file.rpartition(" (hit ")[0] if self.part else self.file

    @property
    def replaced(self) -> str:
        """What is said of it where a newer file takes its place."""
        return f"{REPLACED} {Path(self.whole_name).name}"


class MeasuredMode(msgspec.Struct, frozen=True):
    """One experimental mode; residues in m/(N·s), row by row (NaN as null), [re, im, sd]."""

    frequency_hz: float
    frequency_sd_hz: float
    damping_ratio: float
    damping_sd: float
    shape: tuple[tuple[float, float], ...]
    residue: tuple[tuple[float | None, float | None, float | None], ...]
    probability: float = 1.0

    @property
    def likely(self) -> bool:
        """Whether it is a mode by its own pose's recordings, not only where others vouch."""
        return self.probability >= LEAST_PROBABILITY


class Question(msgspec.Struct, frozen=True):
    """What the engineer is asked of hits that are not what is to be expected of a pose.

    Their FRFs are `off_percent` of the expected ones away from these; `fits` names the pose that
    they fit instead, if there is one. Where hits contradict each other instead, `disagree` are
    their files. `about` is "chain" where units, signs, axes or filters of the chain look wrong,
    "readback" where the joint angles are to be typed otherwise, "earlier" where those of the
    measured pose `fits` are; "" else.
    """

    text: str
    off_percent: float = 0.0
    fits: str = ""
    disagree: tuple[str, ...] = ()
    about: str = ""


class Imported(Event, frozen=True, tag="imported"):
    """Hits at one pose were imported; `modes` are those of all its accepted hits so far.

    With a `question` they are held: not used until a Confirmed follows. `again` names the measured
    pose that is to be hit again, where these hits hint at drift. `replaced` are earlier files of
    the pose (sha256) that newer ones of these take the place of.
    """

    pose: str
    joints_deg: tuple[float, ...]
    hits: tuple[HitRecord, ...]
    modes: tuple[MeasuredMode, ...]
    remarks: tuple[str, ...] = ()
    amplitude: Homogeneity | None = None  # null: all hits of one strength
    question: Question | None = None
    again: str = ""
    replaced: tuple[str, ...] = ()
    instead: tuple[int, ...] = ()  # held imports whose place it takes, as long as it holds itself

    @property
    def unhit(self) -> bool:
        """Whether nothing came of it: every hit was refused."""
        return not self.modes and not any(hit.accepted for hit in self.hits)


class Confirmed(Event, frozen=True, tag="confirmed"):
    """The engineer said that held hits, or those of a withdrawn pose, are to be used."""

    pose: str


class Refused(Event, frozen=True, tag="refused"):
    """The engineer refused hits that waited at a pose; they are kept, and not offered again.

    Or those that were held since the imports of these numbers, as long as it holds itself.
    """

    pose: str
    hits: tuple[HitRecord, ...]
    instead: tuple[int, ...] = ()


class Withdrawn(Event, frozen=True, tag="withdrawn"):
    """A measured pose was set aside; its recordings stay."""

    pose: str
    reason: str = ""


class Skipped(Event, frozen=True, tag="skipped"):
    """A proposed pose cannot or shall not be measured; it is not offered again.

    `neighbours`: what stands in the way there (the reason) does so around it too.
    """

    pose: str
    reason: str = ""
    neighbours: bool = False


class FilesShown(Event, frozen=True, tag="shown"):
    """Files, by content (sha256), that are of a pose: they were shown while the robot was there.

    Or they came `at` the next one and answer as that pose did: a guess, until the engineer says. It
    is logged before anything can become of them, so that they never move on by themselves; the
    first entry that names a file holds.
    """

    pose: str
    files: tuple[str, ...]
    at: str = ""


class FilesPlaced(Event, frozen=True, tag="placed"):
    """The engineer said that files shown at another pose are of this one."""

    pose: str
    files: tuple[str, ...]


class Starred(Event, frozen=True, tag="starred"):
    """The engineer marked a pose as worth a second look."""

    pose: str


class Undone(Event, frozen=True, tag="undone"):
    """The acts with these sequence numbers were taken back.

    Of an Undone: what that took back holds again.
    """

    acts: tuple[int, ...]


AnyEvent = (
    Configured
    | Proposed
    | Imported
    | Confirmed
    | Refused
    | Withdrawn
    | Skipped
    | FilesShown
    | FilesPlaced
    | Starred
    | Undone
)


class Entry(msgspec.Struct, frozen=True):
    """An event with its place in the log (`seq` from 1) and the time (UTC, ISO 8601)."""

    seq: int
    time: str
    event: AnyEvent
