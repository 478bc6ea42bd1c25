"""The pool: every recorded pose with its modes and FRFs, made from its hits once and kept."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from planner.campaign.config import ModesTable
from planner.campaign.journal import write_synced
from planner.campaign.log_conversion import from_modal
from planner.campaign.state import Measurement
from planner.campaign.store import read_bytes
from planner.compare import content_hash
from planner.dataset.measure import Source, measure
from planner.frf.frf import Frf
from planner.recording.folder import read_recordings
from planner.recording.records import PoseRow

ARRAYS = ("frequency_hz", "accelerance", "variance", "coherence")


class Refusal(msgspec.Struct, frozen=True):
    """A file that could not be used, and why."""

    file: str
    reason: str


class FrfText(msgspec.Struct, frozen=True):
    """What an FRF holds beside arrays; no `tail_s` stands for ∞, which JSON does not have."""

    hits: tuple[int, int, int]
    usable_band_hz: tuple[float, float]
    exponential_rate_1_s: float
    remarks: tuple[str, ...]
    tail_s: float | None
    force_window_s: float

    @classmethod
    def of(cls, frf: Frf) -> "FrfText":
        tail_s = frf.tail_s if np.isfinite(frf.tail_s) else None
        return cls(
            frf.hits, frf.usable_band_hz, frf.exponential_rate_1_s, frf.remarks, tail_s,
            frf.force_window_s,
        )  # fmt: skip

    def frf(self, arrays: dict[str, np.ndarray]) -> Frf:
        tail_s = float("inf") if self.tail_s is None else self.tail_s
        return Frf(
            arrays["frequency_hz"],
            arrays["accelerance"],
            arrays["variance"],
            arrays["coherence"],
            self.hits,
            self.usable_band_hz,
            self.exponential_rate_1_s,
            self.remarks,
            tail_s,
            arrays.get("force_share"),
            self.force_window_s,
        )


class Made(msgspec.Struct, frozen=True):
    """What is kept of a pose beside the FRF's arrays."""

    measurement: Measurement
    refused: tuple[Refusal, ...]
    reason: str  # why there are no modes; empty where there are
    simulated: bool
    frf: FrfText | None


@dataclass(frozen=True, eq=False)
class PoolPose:
    """A recorded pose; `frf` is None where no hit could be used."""

    measurement: Measurement
    frf: Frf | None
    refused: tuple[Refusal, ...]
    reason: str
    simulated: bool


@dataclass(frozen=True)
class PoseFiles:
    """One pose of recordings.csv with its files, and the hash of all that its modes hang on."""

    rows: tuple[PoseRow, ...]
    table: ModesTable
    key: str


def poses_of(folder: Path, joint_names: Sequence[str], table: ModesTable) -> tuple[PoseFiles, ...]:
    """The poses of a recordings folder in recorded order; InputError where it is wrong."""
    groups: dict[str, list[PoseRow]] = {}
    for row in read_recordings(folder, tuple(joint_names)).rows:
        groups.setdefault(row.pose, []).append(row)
    return tuple(_files(tuple(rows), table) for rows in groups.values())


def _files(rows: tuple[PoseRow, ...], table: ModesTable) -> PoseFiles:
    told = [(r.joints_deg, r.hit, r.repeat, r.file and r.file.name) for r in rows]
    data = [content_hash.digest(read_bytes(r.file)) for r in rows if r.file]
    how = (table.band_hz, table.window_rate_1_s)
    parts = content_hash.program(), rows[0].pose, content_hash.of(told), content_hash.of(how)
    return PoseFiles(rows, table, content_hash.digest(*parts, *data))


def make(_: None, pose: PoseFiles) -> bytes:
    """Turn the hits of a pose into modes and FRFs; as bytes that `unpack` reads."""
    first = pose.rows[0]
    sources = tuple(Source(r.file, str(r.file), r.hit, r.repeat) for r in pose.rows if r.file)
    table = pose.table
    found = measure(sources, table.band_hz, window_rate_1_s=table.window_rate_1_s)
    modes = from_modal(found.modal)
    refused = tuple(Refusal(v.source.name, v.reason) for v in found.verdicts if not v.accepted)
    reason = "" if modes else (found.remarks[-1] if found.remarks else "No mode was found.")
    arrays = {} if found.frf is None else {n: getattr(found.frf, n) for n in ARRAYS}
    if found.frf is not None and found.frf.force_share is not None:
        arrays["force_share"] = found.frf.force_share
    made = Made(
        Measurement(first.pose, first.joints_deg, (), modes, found.remarks),
        refused,
        reason,
        any(v.simulated for v in found.verdicts),
        FrfText.of(found.frf) if found.frf else None,
    )
    buffer = io.BytesIO()
    np.savez(buffer, made=np.frombuffer(content_hash.of(made), np.uint8), **arrays)
    return buffer.getvalue()


def unpack(data: bytes) -> PoolPose:
    """The pose that `make` put into bytes."""
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    made = msgspec.json.decode(arrays.pop("made").tobytes(), type=Made)
    frf = made.frf.frf(arrays) if made.frf else None
    return PoolPose(made.measurement, frf, made.refused, made.reason, made.simulated)


def kept(folder: Path, pose: PoseFiles) -> PoolPose | None:
    """The pose as it was made before; None if it was not."""
    path = folder / f"{pose.key}.npz"
    return unpack(path.read_bytes()) if path.exists() else None


def keep(folder: Path, pose: PoseFiles, data: bytes) -> PoolPose:
    """Keep what was made of a pose."""
    write_synced(folder / f"{pose.key}.npz", data)
    return unpack(data)
