"""What a recording holds, before anything is computed from it: what an instrument can give."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from planner.errors import InputError
from planner.recording.points import NOT_STATED, SENSOR, TCP, Dof, Layout, StatedPoints

AXES = ("x", "y", "z")
NOTICED = "noticed"  # kind of a fault that is no reason, but what the reader has to say
# Chosen: far beyond any hammer, accelerometer or FRF in SI, and far from where squares overflow.
LARGEST = 1e15
MAX_BYTES = 512 * 1024 * 1024  # of a file
SLOWEST_HZ, FASTEST_HZ = 1e-3, 1e9  # sampling rates; slower or faster is a wrong unit
OF_TOOL = tuple(Dof(SENSOR, axis) for axis in AXES)
# The force belongs to the pulse where it exceeds this share of the peak and this many sds of noise.
PULSE_SHARE, PULSE_SDS = 0.1, 4.0
# Something has begun to happen where the force first exceeds these; a few samples earlier still.
RISING_SHARE, RISING_SDS, RISING_SAMPLES = 0.01, 5.0, 4
NORMAL_MAD = 1.4826  # sd of normal noise over its median absolute deviation
# Samples for which an anti-alias filter rings before and after a pulse, beside WIDTHS of the pulse.
RINGING_SAMPLES, RINGING_WIDTHS = 32, 3


@dataclass(frozen=True, eq=False)
class Channel:
    """One time history as stored in a file, converted to SI where its unit is stated.

    `quantity` is "force", "acceleration", "velocity", "displacement", "pressure", "voltage" or
    "unknown"; `unit` the SI unit of `samples` ("N", "m/s^2", …, "V", "" when the file states none).
    `direction` is ±1, ±2, ±3 for ±x, ±y, ±z, 0 when the file states none; `node` the name of a
    point or the digits of a node number, "" when it states none.
    """

    name: str
    quantity: str
    unit: str
    direction: int
    samples: np.ndarray  # (n,)
    node: str = ""


@dataclass(frozen=True)
class Fault:
    """Why a hit was refused (`refuse` true) or is only remarked upon."""

    kind: str  # "clipped", "double_hit", "too_weak", "too_soft", "wrong_axis", "incoherent", …
    text: str  # one sentence: what is wrong, with figures, and what to do
    refuse: bool = True


@dataclass(frozen=True, eq=False)
class TimeRecord:
    """Simultaneously sampled channels of one file.

    `faults` were found before it was known what it holds. `at_s` is, of a hit that was cut out of a
    longer record, the time of its pulse in that record; None where the record is as it was stored.
    """

    source: Path
    sampling_rate_hz: float
    channels: tuple[Channel, ...]
    remarks: tuple[str, ...] = ()  # what the reader noticed and the user should know
    simulated: bool = False  # the file says that it holds simulated, not measured, data
    faults: tuple[Fault, ...] = ()
    at_s: float | None = None


class End(NamedTuple):
    """Where an FRF was felt, or hit: a point's name and the direction there.

    Directions are ±1, ±2, ±3, 0 where the file states none; up to ±6 they are rotations. A node is
    "0" where the file states none, "" where its format knows none.
    """

    node: str
    direction: int


@dataclass(frozen=True, eq=False)
class FrfRecord:
    """FRFs exported by an analyser (UFF function type 4 and the like).

    `values[k]` is the response per unit force at `places[k]`, felt and hit; `quantity` is
    "accelerance" (m/s²/N), "mobility", "receptance" or "unknown"; `unit` the unit of the values.
    `coherence` is NaN where the file has none.
    """

    source: Path
    frequency_hz: np.ndarray  # (F,)
    values: np.ndarray  # (k, F) complex
    places: tuple[tuple[End, End], ...]
    quantity: str
    unit: str
    coherence: np.ndarray  # (k, F)
    remarks: tuple[str, ...] = ()
    simulated: bool = False


Record = TimeRecord | FrfRecord


class Pulse(NamedTuple):
    """Samples and sizes of a pulse.

    `quiet` samples at the record's start hold nothing but noise; the pulse itself is samples
    `first` up to but not including `end`, with its largest deviation at `peak`. `offset_n` (N) is
    the force at rest, `peak_n` (N) the size of that deviation, `noise_n` (N) the sd of the noise.
    """

    quiet: int
    first: int
    peak: int
    end: int
    offset_n: float
    peak_n: float
    noise_n: float

    def around(self, samples: int) -> tuple[int, int]:
        """Range (first, end) of a record of `samples` that holds the anti-alias ringing too."""
        margin = RINGING_SAMPLES + RINGING_WIDTHS * (self.end - self.first)
        return max(0, self.first - margin), min(samples, self.end + margin)


def find_pulse(force_n: np.ndarray) -> Pulse:
    """The main pulse of a force (n,) in N.

    It reaches as far around the peak as the force stays above PULSE_SHARE of the peak and PULSE_SDS
    of the noise. The noise is judged by the median, which a short pulse does not move.
    """
    offset = float(np.median(force_n))
    size = np.abs(force_n - offset)
    peak, noise = int(np.argmax(size)), NORMAL_MAD * float(np.median(size))
    top = float(size[peak])
    small = size <= max(PULSE_SHARE * top, PULSE_SDS * noise)
    before, after = np.flatnonzero(small[:peak]), np.flatnonzero(small[peak + 1 :])
    first = int(before[-1]) + 1 if before.size else 0
    end = peak + 1 + int(after[0]) if after.size else len(size)
    rising = np.flatnonzero(size > max(RISING_SHARE * top, RISING_SDS * noise))
    quiet = max(0, int(rising[0]) - RISING_SAMPLES) if rising.size else 0
    return Pulse(quiet, first, peak, end, offset, top, noise)


@dataclass(frozen=True, eq=False)
class Hit:
    """One hammer hit: the force, and the accelerations of all sensors, as recorded.

    `axis` is the hit direction as a signed axis of the hit point's frame ("+x" … "-z"): the force
    acts on the structure along that signed axis, so that H_xx of a "-x" hit is −a_x/F. Rows of
    `acceleration_m_s2` are `responses`, point and axis of its frame; of the tool's sensor alone
    they are x, y and z (parallel to those of the tcp). `hit_point` and the responses' nodes are
    names of points as in `points.Layout`.
    """

    source: Path
    axis: str
    sampling_rate_hz: float
    force_n: np.ndarray  # (n,)
    acceleration_m_s2: np.ndarray  # (r, n)
    simulated: bool = False
    hit_point: str = TCP
    responses: tuple[Dof, ...] = OF_TOOL
    faults: tuple[Fault, ...] = ()  # of its record, see `TimeRecord`

    @cached_property
    def pulse(self) -> Pulse:
        """Where the force's pulse lies."""
        return find_pulse(self.force_n)

    @property
    def layout(self) -> Layout:
        """Its point, and its sensors in the order of the responses."""
        return Layout((self.hit_point,), tuple(dict.fromkeys(d.node for d in self.responses)))

    @property
    def rows(self) -> list[int]:
        """Rows of its layout that were measured."""
        sensors = self.layout.sensors
        return [3 * sensors.index(d.node) + abs(d.number) - 1 for d in self.responses]

    def channels_of(self, sensor: str) -> "Hit | None":
        """The hit as one triaxial sensor has it, x, y, z; None where it has not all three."""
        if self.responses == tuple(Dof(sensor, axis) for axis in AXES):
            return self
        found = [i for axis in AXES for i, d in enumerate(self.responses) if d == Dof(sensor, axis)]
        return self.with_channels(found) if len(found) == len(AXES) else None

    def with_channels(self, rows: list[int]) -> "Hit":
        """The hit as some of its channels have it."""
        responses = tuple(self.responses[i] for i in rows)
        return replace(self, acceleration_m_s2=self.acceleration_m_s2[rows], responses=responses)

    def label(self, row: int) -> str:
        """A response in words: "x", of another sensor than the tool's "elbow x"."""
        dof = self.responses[row]
        if dof.node.endswith(NOT_STATED):
            return dof.node
        return dof.direction if dof.node == SENSOR else f"{dof.node} {dof.direction}"

    @property
    def axis_index(self) -> int:
        """0, 1, 2 for x, y, z."""
        return AXES.index(self.axis[1])

    @property
    def sign(self) -> float:
        """+1 or −1: sense of the hit along its axis."""
        return -1.0 if self.axis[0] == "-" else 1.0


@dataclass(frozen=True)
class PoseRow:
    """One row of recordings.csv (`file` is absolute) or of predict.csv (without `hit`, `file`).

    `joints_deg` are degrees, of joints that slide millimetres (`joints.JointUnits`): so it is
    wherever a list of joint values has this name. () where the table has no column of joints.
    """

    pose: str
    joints_deg: tuple[float, ...]
    row: int  # line in the CSV file, the header being line 1
    hit: str | None = None
    repeat: int | None = None
    file: Path = Path()
    peak_force_n: float | None = None
    response: str | None = None  # signed axis of an FRF's response, where the table says it
    hits: tuple[str, ...] = ()  # of a file with several hits that has a row for each
    stated: StatedPoints = field(default_factory=StatedPoints)


def check_records(path: Path, records: Sequence[Record]) -> None:
    """Raise InputError saying what of the records of a file no instrument can have given."""
    for record in records:
        if isinstance(record, FrfRecord):
            lines, frfs = record.frequency_hz, record.values
            if len(lines) < 2:
                raise InputError(
                    f"{path} holds FRFs of shape {frfs.shape} over {lines.size} frequency lines; "
                    f"export FRFs and their frequencies together."
                )
            check_numbers(path, "frequency", lines)
            if lines[0] < 0 or not np.all(np.diff(lines) > 0):
                raise InputError(
                    f"{path}: the FRFs' frequency lines do not rise; export them in order."
                )
            for number, row in enumerate(frfs, 1):
                check_numbers(path, f"FRF {number}", row)
            continue
        rate = record.sampling_rate_hz
        if not SLOWEST_HZ <= rate <= FASTEST_HZ:
            raise InputError(
                f"{path} was sampled at {rate:.4g} Hz as it says; correct the time's unit or step."
            )
        for channel in record.channels:
            check_numbers(path, channel.name, channel.samples)


def check_numbers(path: Path, name: str, values: np.ndarray) -> None:
    """Raise InputError where one of `values` (n,) is not finite or absurdly large."""
    sane = np.abs(values) < LARGEST  # NaN is not
    if not np.all(sane):
        at = int(np.argmin(sane))
        fault = "is not a finite number"
        if np.isfinite(values[at]):
            fault = f"is {abs(values[at]):.3g}, which no instrument gives"
        raise InputError(f"{path}: {name}, sample {at + 1} {fault}; export it again.")
