"""Records of a recorder that ran on while one hit again and again, in every format there is."""

import struct
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import scipy.io
from scipy import signal

from planner.proof.recordings import uff_channel, write_sets
from planner.recording.hits import hits_from
from planner.recording.read import read
from tests.support import hit_files
from tests.support.hit_files import named

RATE_HZ, FINER = 1024, 8
MODES = (12.0, 0.03), (23.0, 0.025), (41.0, 0.02)  # Hz, damping ratio
SHAPES = np.array([[0.94, 0.31, 0.16], [0.27, 0.89, 0.36], [0.17, -0.34, 0.93]])
CLEAN = ((1.0, 700.0), (5.0, 900.0), (9.2, 600.0)), 13.0  # hits (s, N), length (s)
# The third rebounds, the fourth is soft, the last is cut off.
MIXED = (
    ((1.5, 700.0), (6.0, 650.0), (10.0, 800.0), (10.04, 400.0), (15.0, 100.0), (19.5, 900.0),
     (24.0, 700.0)), 24.4,
)  # fmt: skip
SCALES = (4000.0, 60.0, 60.0, 60.0)  # N and m/s² at full scale of a WAV file


def stream(
    hits: Sequence[tuple[float, float]], length_s: float, axis: str = "+x", seed: int = 0
) -> np.ndarray:
    """Force and accelerations (4, n) at RATE_HZ, with noise and an anti-alias filter's ringing.

    The modes have 100 kg each; their response is stepped finely in time.
    """
    rng = np.random.default_rng(seed)
    fine = RATE_HZ * FINER
    t = np.arange(round(length_s * fine)) / fine
    force = sum(p * np.sin(np.pi * np.clip((t - at) / 0.004, 0, 1)) ** 2 for at, p in hits)
    pushed = force * (-1.0 if axis[0] == "-" else 1.0)
    response = np.zeros((3, t.size))
    for (hz, ratio), shape in zip(MODES, SHAPES, strict=True):
        w = 2 * np.pi * hz
        system = [1.0, 0.0, 0.0], [1.0, 2 * ratio * w, w**2]
        ((b,), a, _) = signal.cont2discrete(system, 1 / fine, "foh")
        answer = signal.lfilter(b, a, pushed)
        response += np.outer(shape * shape["xyz".index(axis[1])] / 100.0, answer)
    sos = signal.butter(6, 0.4 * RATE_HZ, fs=fine, output="sos")
    both = np.asarray(signal.sosfilt(sos, np.vstack([force, response])))[:, ::FINER]
    return both + np.array([[0.3], [4e-3], [4e-3], [4e-3]]) * rng.standard_normal(both.shape)


def joined(folder: Path, axis: str) -> np.ndarray:
    """The hits of a folder along an axis ("px") after each other, almost at rest in between."""
    rng, parts = np.random.default_rng(0), []
    for file in sorted((folder / "data").glob(f"*_{axis}_*.uff")):
        (hit,) = hits_from(read(file))
        one = np.vstack([hit.force_n, hit.acceleration_m_s2])
        parts += [one, np.tile(rng.permutation(one[:, -64:].T).T, 4)]
    return np.hstack(parts)


def write_uff(path: Path, samples: np.ndarray, axis: str) -> None:
    along = ("xyz".index(axis[1]) + 1) * (-1 if axis[0] == "-" else 1)
    kinds = zip(samples, (along, 1, 2, 3), (True, *3 * (False,)), strict=True)
    write_sets(path, (uff_channel(values, RATE_HZ, (1, direction), (1, along), force)
                      for values, direction, force in kinds))  # fmt: skip


def write_wav(
    path: Path, samples: np.ndarray, axis: str, bits: int = 24, rate_hz: int = RATE_HZ
) -> None:
    """PCM of 16, 24 or 32 bits or, of 0 bits, floating-point numbers; the table gets its rows."""
    write_scales(path, axis)
    shares = samples.T / np.array(SCALES)
    if bits == 0:
        return scipy.io.wavfile.write(path, rate_hz, shares.astype(np.float32))
    whole = np.round(shares * 2 ** (bits - 1)).astype(np.int32)
    if bits != 24:
        return scipy.io.wavfile.write(path, rate_hz, whole.astype(f"int{bits}"))
    data = np.ascontiguousarray(whole, "<i4").view(np.uint8).reshape(-1, 4)[:, :3].tobytes()
    form = struct.pack("<HHIIHH", 1, 4, rate_hz, rate_hz * 12, 12, 24)
    body = b"WAVEfmt " + struct.pack("<I", 16) + form + b"data" + struct.pack("<I", len(data))
    path.write_bytes(b"RIFF" + struct.pack("<I", len(body) + len(data)) + body + data)


def write_scales(path: Path, axis: str) -> None:
    """Rows of channels.csv beside a WAV file."""
    table = path.with_name("channels.csv")
    if not table.exists():
        table.write_text("file,channel,name,unit,full_scale,hit\n")
    names = ("force", "acceleration x", "acceleration y", "acceleration z")
    rows = zip(names, ("N", *3 * ("m/s^2",)), SCALES, strict=True)
    with open(table, "a") as file:
        for number, (name, unit, scale) in enumerate(rows, 1):
            file.write(f"{path.name},{number},{name},{unit},{scale},{axis}\n")


WRITERS: dict[str, Callable[[Path, np.ndarray, str], object]] = {
    suffix: lambda path, samples, axis, write=write: write(path, named(samples, RATE_HZ), axis)
    for suffix, write in hit_files.WRITERS.items()
} | {".uff": write_uff, ".wav": write_wav}
