"""Single channels that cannot be used: dead ones, and such as were overloaded."""

import math
from dataclasses import dataclass

import numpy as np

from planner.recording.records import Fault, Hit

# Overload: so improbable is it that equal samples at the top are chance, judged by samples that
# lie below the top by a share of NEAR at most. A pulse of NARROW samples above its half is so sharp
# that two are equal in one of 300 at a step of COARSE of its peak.
BY_CHANCE, NEAR, NARROW, COARSE = 5e-4, 0.1, 6, 2e-3

# A channel that stands still does so by its resolution, or because nothing was measured. By its
# resolution it rests for longer and longer while it moves by less and less.
# How a channel moves is judged by so many of its changes: where it fades below its resolution, the
# last ones cover two or three of its steps. It moves where they cover more than STEPS, and rests
# unlike before beyond LONGER times their longest rest. One channel alone has to be surer: SURELY
# steps. SKEW: samples by which channels may end one before the other; fewer are not worth a word.
# All chosen.
CHANGES, STEPS, SURELY, LONGER, SKEW = 8, 4.0, 12.0, 4, 16


@dataclass(frozen=True)
class Rest:
    """A channel's last value: from which sample on, and by how many steps it moved until then.

    No steps where it may rest by its resolution.
    """

    start: int
    steps: float

    @classmethod
    def of(cls, samples: np.ndarray) -> "Rest":
        """Of a channel (n,) that is not constant."""
        start = int(np.flatnonzero(samples != samples[-1])[-1]) + 1
        before = samples[:start]
        changes = np.flatnonzero(np.diff(before))[-CHANGES:]
        if len(changes) < CHANGES:
            return cls(start, 0.0)
        if len(samples) - start <= max(SKEW, LONGER * int(np.max(np.diff(changes)))):
            return cls(start, 0.0)
        return cls(start, float(np.ptp(before[changes[0] :]) / step(before)))


def channel_faults(hit: Hit) -> tuple[Fault, ...]:
    """Faults of the force and of each acceleration by itself."""
    force = _overload("force", "N", hit.force_n, pulse=True)
    answers = (_of_acceleration(hit, row) for row in range(len(hit.responses)))
    return tuple(fault for fault in (force, *answers) if fault is not None)


def by_good_sensors(hit: Hit) -> tuple[Hit, tuple[Fault, ...]]:
    """The hit as its good sensors have it, and remarks on channels of the others.

    A sensor with a channel that cannot be used is left out, where another one is whole; where
    none is the hit stays as it was, to be refused.
    """
    found = [_of_acceleration(hit, row) for row in range(len(hit.responses))]
    named = [dof.node for dof in hit.responses]
    bad = {node for node, fault in zip(named, found, strict=True) if fault}
    good = [row for row, node in enumerate(named) if node not in bad]
    if not bad or not good:
        return hit, ()
    but = "The other sensors of this hit are used, the one at {} is not."
    told = (
        Fault(fault.kind, f"{fault.text} {but.format(node)}", refuse=False)
        for node, fault in zip(named, found, strict=True) if fault
    )  # fmt: skip
    return hit.with_channels(good), tuple(told)


def _of_acceleration(hit: Hit, row: int) -> Fault | None:
    samples, name = hit.acceleration_m_s2[row], hit.label(row)
    if not np.any(samples - samples[0]):
        text = f"The acceleration along {name} is constant"
        return Fault("dead", f"{text}; check the cable of {name}.")
    rest = Rest.of(samples)
    if rest.steps > SURELY:
        seconds = (len(samples) - rest.start) / hit.sampling_rate_hz
        text = f"The acceleration along {name} repeats one value for the last {seconds:.2g} s"
        return Fault("dead", f"{text}, though it moved until then; check the cable of {name}.")
    return _overload(f"acceleration {name}", "m/s²", samples, pulse=False)


def _overload(name: str, unit: str, samples: np.ndarray, pulse: bool) -> Fault | None:
    """Overload leaves the top flat: several samples (n,) equal to the last digit."""
    size = samples - np.median(samples)
    for sense in (1.0, -1.0):
        top = float(np.max(sense * size))
        equal = sense * size >= top * (1 - 1e-6)
        # A pulse has one top; a decaying response reaches the same top again and again.
        flat = _longest_run(equal) if pulse else int(np.sum(equal))
        if not _by_chance(np.maximum(sense * size, 0.0), flat, pulse):
            level = float(samples[int(np.argmax(sense * size))])
            text = f"The {name} is clipped at {level:.4g} {unit} ({flat} samples)"
            return Fault("clipped", f"{text}; raise the range of {name} or hit more softly.")
    return None


def _by_chance(size: np.ndarray, flat: int, pulse: bool) -> bool:
    """Whether so many samples of |a channel| may be equal at its top without an overload.

    Stored in steps, samples fall upon the top as upon any other step nearby: as often as by the
    Poisson distribution. A pulse so narrow has a top so sharp that no two are equal.
    """
    top = float(np.max(size))
    if top <= 0 or flat < 2:
        return True
    rounding = step(size)
    if pulse and int(np.sum(size > 0.5 * top)) <= NARROW and rounding < COARSE * top:
        return False
    if rounding > NEAR * top:
        return True  # of so few steps nobody could tell
    near = np.sum((size > (1 - NEAR) * top) & (size < top * (1 - 1e-6)))
    each = (float(near) + 1) * rounding / (NEAR * top)
    # Of the Poisson distribution: each^(flat−1) / (flat−1)!
    return (flat - 1) * math.log(each) - math.lgamma(flat) > math.log(BY_CHANCE)


def step(samples: np.ndarray) -> float:
    """The step in which a converter stored samples (n,): least difference of any two."""
    steps = np.diff(np.unique(samples))
    steps = steps[steps > 1e-9 * np.max(np.abs(samples))]
    return float(np.min(steps)) if steps.size else 0.0


def _longest_run(mask: np.ndarray) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return int(np.max(edges[1::2] - edges[::2], initial=0))
