"""Simulated hammer hits: exact response to a pulse, the analyser's filter, noise, one UFF a hit."""

import csv
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy import signal

from planner.proof.model import Truth

OVERSAMPLING = 16  # time steps of the solution per sample of the analyser
AXES = ("x", "y", "z")
LEAST_HZ = 0.2  # below which 1/f noise grows no more
FULL_SCALE = 4.0  # of a converter over what comes
FLOOR_DAMPING = 0.3  # ratio, of a floor's first mode with machines on it; chosen


def signed(axis: str) -> tuple[int, float]:
    """Number and sense of an axis such as "-y": 1, -1.0."""
    return AXES.index(axis[1]), -1.0 if axis[0] == "-" else 1.0


@dataclass(frozen=True)
class Hammer:
    """What the person, the hammer, the analyser and the floor are like.

    Noise is relative: of the responses to the hit's largest response (rms), of the force to its
    peak. Readback angles scatter by `readback_deg` (`readback_mm`)
    around the setpoint.
    """

    peak_n: float = 1200.0
    duration_s: float = 0.008
    sampling_rate_hz: float = 400.0
    record_s: float = 2.56
    pretrigger_s: float = 0.06
    noise: float = 0.02
    force_noise: float = 5e-4
    readback_deg: float = 0.01
    readback_mm: float = 0.1  # of joints that slide
    oversampling: int = OVERSAMPLING
    corner_hz: float = 0.0  # below which noise grows as 1/f
    bits: int = 0  # of the converter, whose full scale is four times what comes; 0: exact
    rumble_m_s2: float = 0.0  # rms of the floor's slow vibration, in every channel
    rumble_hz: float = 4.0  # where most of it is

    @property
    def step_s(self) -> float:
        """Between time steps of the solution."""
        return 1 / (self.sampling_rate_hz * self.oversampling)


@dataclass(frozen=True, eq=False)
class SimulatedHit:
    """force_n (n,) ≥ 0 along `axis` of the hit point, acceleration_m_s2 (3s, n) of the sensors."""

    axis: str
    force_n: np.ndarray
    acceleration_m_s2: np.ndarray
    hit_point: str = "tcp"
    sensors: tuple[str, ...] = ("sensor",)


def simulate_hit(
    truth: Truth, q: np.ndarray, axis: str, hammer: Hammer, rng: np.random.Generator
) -> SimulatedHit:
    """One hit at pose q (rad) along a signed axis of the tcp frame ("+x")."""
    force = pulse(hammer, rng)
    index, sense = signed(axis)
    response = truth.respond(q, sense * force, index, hammer.step_s)
    return noisy(sampled(axis, force, response, hammer), hammer, rng)


def pulse(hammer: Hammer, rng: np.random.Generator) -> np.ndarray:
    """A hammer's pulse (n,) at the fine rate, sin^1.5 over its duration; no two hits are alike."""
    rate_hz = 1 / hammer.step_s
    t = np.arange(round(hammer.record_s * rate_hz)) / rate_hz
    start = hammer.pretrigger_s + rng.uniform(0, 2 / hammer.sampling_rate_hz)
    duration = hammer.duration_s * rng.uniform(0.85, 1.15)
    phase = np.clip((t - start) / duration, 0.0, 1.0)
    return hammer.peak_n * rng.uniform(0.75, 1.25) * np.sin(np.pi * phase) ** 1.5


def sampled(axis: str, force: np.ndarray, response: np.ndarray, hammer: Hammer) -> SimulatedHit:
    """What the analyser keeps of a force (n,) and responses (3, n) at the fine rate, noise-free."""
    fine = hammer.sampling_rate_hz * hammer.oversampling
    # The analyser's anti-alias filter, the same on all channels.
    sos = signal.butter(6, 0.4 * hammer.sampling_rate_hz, fs=fine, output="sos")
    filtered = np.asarray(signal.sosfilt(sos, np.vstack([force, response])))
    step = hammer.oversampling
    return SimulatedHit(axis, filtered[0, ::step], filtered[1:, ::step])


def largest_rms(hit: SimulatedHit) -> float:
    """Of the accelerations, in m/s²."""
    return float(np.max(np.sqrt(np.mean(hit.acceleration_m_s2**2, axis=1))))


def noisy(hit: SimulatedHit, hammer: Hammer, rng: np.random.Generator) -> SimulatedHit:
    """The hit with the noise of all channels, and the floor's rumble."""
    f, a = hit.force_n, hit.acceleration_m_s2
    f = f + hammer.force_noise * np.max(f) * _noise(f.shape, hammer, rng)
    a = a + hammer.noise * largest_rms(hit) * _noise(a.shape, hammer, rng)
    if hammer.rumble_m_s2 > 0:
        a = a + _rumble(a.shape, hammer, rng)
    f, a = (_converted(samples, hammer) for samples in (f, a))
    return replace(hit, force_n=f, acceleration_m_s2=a)


def noise_power(hit: SimulatedHit, hammer: Hammer) -> np.ndarray:
    """Mean square (lines,) of an acceleration channel's noise in each line of `rfft`; of `hit`."""
    n = hit.force_n.size
    own = n * (hammer.noise * largest_rms(hit)) ** 2 * _pink(n, hammer)
    return own + (n * hammer.rumble_m_s2) ** 2 * _rumble_shape(n, hammer)


def _noise(shape: tuple[int, ...], hammer: Hammer, rng: np.random.Generator) -> np.ndarray:
    """White noise of 1, and 1/f below the corner."""
    white = rng.standard_normal(shape)
    if hammer.corner_hz == 0:
        return white
    shaped = np.fft.rfft(white) * np.sqrt(_pink(shape[-1], hammer))
    return np.fft.irfft(shaped, shape[-1])


def _pink(n: int, hammer: Hammer) -> np.ndarray:
    """Power (lines,) of noise over that of white noise."""
    frequency = np.fft.rfftfreq(n, 1 / hammer.sampling_rate_hz)
    return 1 + hammer.corner_hz / np.maximum(frequency, LEAST_HZ)


def _converted(samples: np.ndarray, hammer: Hammer) -> np.ndarray:
    if hammer.bits == 0:
        return samples
    step = 2 * FULL_SCALE * np.max(np.abs(samples)) / 2**hammer.bits
    return np.round(samples / step) * step


def _rumble_shape(n: int, hammer: Hammer) -> np.ndarray:
    """Shares (lines,) of the lines of `rfft` in a rumble's mean square: a floor's first mode."""
    frequency = np.fft.rfftfreq(n, 1 / hammer.sampling_rate_hz)
    ratio = frequency / hammer.rumble_hz
    power = ratio**2 / ((1 - ratio**2) ** 2 + (2 * FLOOR_DAMPING * ratio) ** 2)
    return power / (2 * np.sum(power))  # each line stands for two


def _rumble(shape: tuple[int, ...], hammer: Hammer, rng: np.random.Generator) -> np.ndarray:
    n = shape[-1]
    size = n * hammer.rumble_m_s2 * np.sqrt(_rumble_shape(n, hammer) / 2)
    phase = rng.standard_normal((2, *shape[:-1], n // 2 + 1))
    return np.fft.irfft(size * (phase[0] + 1j * phase[1]), n)


def write_uff(
    path: Path,
    hit: SimulatedHit,
    hammer: Hammer,
    *text: str,
    nodes: Mapping[str, int] | None = None,
) -> None:
    """One hit as UFF 58b, labelled as simulated; up to 4 lines of text go into the header.

    `nodes` are those of the points by name, 1 where there is none.
    """
    axis, sense = signed(hit.axis)
    direction = int(sense) * (axis + 1)
    at = dict(nodes or {})
    struck = at.get(hit.hit_point, 1), direction
    rate, said = (
        hammer.sampling_rate_hz,
        {f"id{k}": line[:80] for k, line in enumerate(text[:4], 2)},
    )
    sets = [uff_channel(hit.force_n, rate, struck, struck, True, rsp_ent_name="hammer", **said)]
    for i, samples in enumerate(hit.acceleration_m_s2):
        sensor, axis = hit.sensors[i // 3], i % 3
        felt, name = (at.get(sensor, 1), axis + 1), f"{sensor} {AXES[axis]}".replace(" ", "_")
        sets.append(uff_channel(samples, rate, felt, struck, rsp_ent_name=name, **said))
    write_sets(path, sets)


def uff_channel(
    samples: np.ndarray, rate_hz: float, felt: tuple[int, int], hit: tuple[int, int],
    force: bool = False, **more: Any,
) -> dict[str, Any]:  # fmt: skip
    """Dataset 58b of a channel: force in N or acceleration in m/s² at a node in a direction."""
    kind, unit = (13, "N") if force else (12, "m/s^2")
    return {
        "type": 58, "binary": 1, "func_type": 1, "id1": "SIMULATED, not measured",
        "rsp_node": felt[0], "rsp_dir": felt[1], "ref_node": hit[0], "ref_dir": hit[1],
        "ord_data_type": 4, "num_pts": samples.size, "abscissa_spacing": 1, "abscissa_min": 0.0,
        "abscissa_inc": 1 / rate_hz, "abscissa_spec_data_type": 17, "abscissa_axis_units_lab": "s",
        "ordinate_spec_data_type": kind, "ordinate_axis_units_lab": unit,
        "orddenom_spec_data_type": 0, "z_axis_spec_data_type": 0,
        "data": np.asarray(samples, dtype=float), "x": np.arange(samples.size) / rate_hz, **more,
    }  # fmt: skip


def write_sets(path: Path, sets: Iterable[dict[str, Any]]) -> Path:
    """A universal file of these alone."""
    import pyuff

    path.unlink(missing_ok=True)  # and "add": pyuff's "overwrite" loses sets before the last
    file = pyuff.UFF(str(path))
    for one in sets:
        with warnings.catch_warnings():
            # pyuff leaves closing the file to the garbage collector, which does so right here.
            warnings.simplefilter("ignore", ResourceWarning)
            file.write_sets(one, "add")
    return path


def record_poses(
    truth: Truth,
    poses: Sequence[tuple[str, np.ndarray]],
    folder: Path,
    hits: Sequence[str] = ("+x", "+y", "+z"),
    repeats: int = 4,
    hammer: Hammer | None = None,
    seed: int = 0,
) -> Path:
    """A recordings folder of poses (name, q in rad); returns its path.

    Angles in recordings.csv are the readback, and it is there that the truth is evaluated.
    """
    hammer = hammer or Hammer()
    rows, slides, shift = [], truth.slides, np.array(truth.slides or False)
    for number, (pose, q) in enumerate(poses):
        rng = np.random.default_rng([seed, number])
        scatter = np.where(shift, hammer.readback_mm, hammer.readback_deg)
        readback = np.round(stated(q, slides) + scatter * rng.uniform(-1, 1, len(q)), 4)
        there = np.where(shift, 1e-3 * readback, np.deg2rad(readback))
        shots = [axis for axis in hits for _ in range(repeats)]
        rows.append((pose, readback, [simulate_hit(truth, there, a, hammer, rng) for a in shots]))
    return write_recordings(
        folder, truth.joint_names, rows, hammer, truth.description, slides=slides
    )


def stated(q: np.ndarray, slides: Sequence[bool]) -> np.ndarray:
    """As tables of recordings state q (dof,): degrees, millimetres of joints that slide."""
    return np.where(np.array(slides or False), 1e3 * q, np.rad2deg(q))


def _columns(joint_names: Sequence[str], slides: Sequence[bool]) -> list[str]:
    units = ["mm" if slide else "deg" for slide in slides or [False] * len(joint_names)]
    return [f"{name}_{unit}" for name, unit in zip(joint_names, units, strict=True)]


def write_recordings(
    folder: Path,
    joint_names: Sequence[str],
    visits: Sequence[tuple[str, np.ndarray, Sequence[SimulatedHit]]],
    hammer: Hammer,
    description: str,
    nodes: Mapping[str, int] | None = None,
    slides: Sequence[bool] = (),
) -> Path:
    """recordings.csv and one UFF file a hit of visits: pose, readback (dof,) in ° (mm), hits.

    Where other points than the tool's are hit or heard, the table names them.
    """
    (folder / "data").mkdir(parents=True, exist_ok=True)
    made = [(pose, readback, hit) for pose, readback, hits in visits for hit in hits]
    elsewhere = any((h.hit_point, h.sensors) != ("tcp", ("sensor",)) for *_, h in made)
    rows, repeats = [], Counter[tuple]()
    for pose, readback, hit in made:
        sign = "m" if hit.axis[0] == "-" else "p"
        at = f"_{hit.hit_point}_{'_'.join(hit.sensors)}" if elsewhere else ""
        repeats[pose, hit.axis, at] += 1
        repeat = repeats[pose, hit.axis, at]
        name = f"data/{pose}_{sign}{hit.axis[1]}_{repeat}{at}.uff"
        what = f"pose {pose}, hit {hit.axis}, repeat {repeat}"
        write_uff(folder / name, hit, hammer, description, what, nodes=nodes)
        points = [hit.hit_point, " ".join(hit.sensors)] if elsewhere else []
        rows.append([pose, *(f"{v:.4f}" for v in readback), hit.axis, repeat, name, *points])
    points = ["hit_point", "response_points"] if elsewhere else []
    head = ["pose", *_columns(joint_names, slides), "hit", "repeat", "file", *points]
    _write_table(folder / "recordings.csv", head, rows)
    return folder


def _write_table(path: Path, head: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([head, *rows])


def write_predict(
    folder: Path,
    joint_names: Sequence[str],
    poses: Sequence[tuple[str, np.ndarray]],
    peak_force_n: float | None = None,
    slides: Sequence[bool] = (),
) -> Path:
    """`predict.csv`: poses (name, q in rad) of which the FRF is wanted."""
    path = folder / "predict.csv"
    force = [] if peak_force_n is None else [f"{peak_force_n:g}"]
    head = ["pose", *_columns(joint_names, slides), *(["peak_force_n"] if force else [])]
    rows = [[pose, *(f"{v:.4f}" for v in stated(q, slides)), *force] for pose, q in poses]
    _write_table(path, head, rows)
    return path
