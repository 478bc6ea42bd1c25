"""Time histories of hits on simulated structures, as files: any points, any number of sensors."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.proof.recordings import uff_channel, write_sets
from tests.support.hit_files import write_table
from tests.support.structures import Structure

RATE_HZ, SAMPLES, LONG = 1024.0, 1024, 16
PULSE_S, BEFORE_S, PEAK_N = 0.004, 0.1, 200.0
NOISE = 2e-3  # of the responses, by their rms


@dataclass(frozen=True, eq=False)
class Tap:
    """A hit at one degree of freedom (index) of a structure, felt at others: n samples each."""

    structure: Structure
    hit: int
    felt: tuple[int, ...]
    force_n: np.ndarray
    acceleration_m_s2: np.ndarray  # (r, n)


def tap(
    structure: Structure,
    hit: int,
    felt: tuple[int, ...],
    rng: np.random.Generator,
    second: float = 0.0,
) -> Tap:
    """Records of 1 s that end while the structure rings.

    Noise on the force is 5e-4 of its peak; `second`: relative size of a second pulse 30 ms later.
    """
    n = SAMPLES * LONG
    t = np.arange(n) / RATE_HZ
    pulses = [(BEFORE_S, 1.0), (BEFORE_S + 0.03, second)]
    force = sum(
        PEAK_N * size * np.sin(np.pi * np.clip((t - at) / PULSE_S, 0, 1)) ** 2
        for at, size in pulses
    )
    hz = np.fft.rfftfreq(n, 1 / RATE_HZ)
    h = np.zeros((len(felt), hz.size), complex)
    h[:, 1:] = structure.accelerance(hz[1:], list(felt), [hit])[:, 0]
    a = np.fft.irfft(h * np.fft.rfft(force), n, axis=1)[:, :SAMPLES]
    a = a + NOISE * np.std(a, axis=1, keepdims=True) * rng.standard_normal(a.shape)
    return Tap(structure, hit, felt, force[:SAMPLES] + 0.1 * rng.standard_normal(SAMPLES), a)


def write_uff(path: Path, taps: list[Tap], turned: bool = False) -> Path:
    """One hit after the other, labelled as simulated; responses along −z where `turned`."""
    sets, sign = [], -1 if turned else 1
    for one in taps:
        nodes = one.structure.nodes
        hit = nodes[one.hit], 3
        sets.append(uff_channel(one.force_n, RATE_HZ, hit, hit, force=True))
        for k, own in zip(one.felt, one.acceleration_m_s2, strict=True):
            sets.append(uff_channel(sign * own, RATE_HZ, (nodes[k], 3 * sign), hit))
    return write_sets(path, sets)


def write_csv(path: Path, one: Tap, columns: str, *attributes: str) -> Path:
    """Named columns, {} where the node goes, below lines of attributes ("hit: +z")."""
    nodes = [f"n{one.structure.nodes[k]}" for k in one.felt]
    names = ["time_s", "force_n", *(columns.format(node) for node in nodes)]
    rows = [np.arange(one.force_n.size) / RATE_HZ, one.force_n, *one.acceleration_m_s2]
    head = (f"# {text}" for text in attributes)
    return write_table(path, dict(zip(names, rows, strict=True)), *head)
