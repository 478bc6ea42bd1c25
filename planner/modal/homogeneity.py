"""Does the structure answer in proportion? FRFs and modes per force level.

A linear structure has one FRF however hard it is hit (homogeneity; Worden & Tomlinson,
Nonlinearity in Structural Dynamics, 2001, section 2.3). Friction, play and hardening make its
frequencies and damping depend on the level.

Where the level says nothing of a hit, hits shared out among the levels at random differ from level
to level as much as they really do (Anderson 2001, PERMANOVA): nothing is assumed of how large their
scatter is.
"""

from math import factorial, prod

import numpy as np

from planner.errors import RefusedError
from planner.frf.estimator import estimate
from planner.frf.frf import Frf
from planner.frf.spectra import transform
from planner.modal.estimate_modes import estimate_modes
from planner.modal.mac import mac
from planner.modal.modes import ForceLevel, Homogeneity, ModalModel
from planner.recording.force_levels import by_level
from planner.recording.records import Hit
from planner.recording.repeats import untilted

# What is worth telling: FRFs that differ by this share, with such odds against chance.
SHARE, CHANCE = 0.03, 1e-3
SHARED_OUT = 4000  # times that hits are shared out among the levels at random


def homogeneity(
    hits: tuple[Hit, ...],
    modal: ModalModel,
    band_hz: tuple[float, float],
    window_rate_1_s: float = 0.0,
) -> tuple[Homogeneity, str] | None:
    """Compare the force levels among the hits of one pose; None if there is only one level.

    What the engineer has to know of it, "" where that is nothing, follows. `window_rate_1_s` is
    that of an exponential window that the records carry.
    """
    groups = by_level(hits)
    if len(groups) < 2:
        return None
    try:
        frfs = [estimate(group, band_hz, window_rate_1_s=window_rate_1_s) for group in groups]
    except RefusedError:
        return None
    each = zip(groups, frfs, strict=True)
    levels = tuple(_level(group, frf, modal, band_hz) for group, frf in each)
    pairs = [(a, b) for a in range(len(frfs)) for b in range(a)]
    worst = max(_difference(frfs[a], frfs[b], band_hz) for a, b in pairs)
    p = _chance(groups, band_hz, window_rate_1_s)
    same = worst < SHARE or p is None or p > CHANCE
    found = Homogeneity(levels, worst, 1.0 if p is None else p, same)
    return found, _remark(found, p is not None)


def _remark(found: Homogeneity, repeated: bool) -> str:
    """One sentence for the engineer; empty where the structure answers in proportion.

    Where hits were not repeated chance cannot be told.
    """
    if found.homogeneous if repeated else found.difference < SHARE:
        return ""
    low, high = found.levels[0], found.levels[-1]
    differ = (
        f"FRFs at {low.peak_force_n:.0f} N and {high.peak_force_n:.0f} N differ by "
        f"{100 * found.difference:.0f} %"
    )
    if not repeated:
        return (
            f"{differ}. Either the response is not proportional to the force, or hits missed the "
            "point or the axis; hit twice at each level to see which."
        )
    text = f"The response is not proportional to the force: {differ}"
    (f0, sd0, zeta0), (f1, sd1, zeta1) = (
        np.array([at.frequency_hz, at.frequency_sd_hz, at.damping_ratio], dtype=float)
        for at in (low, high)
    )
    change, sd = np.log(f1 / f0), np.hypot(sd0 / f0, sd1 / f1)
    clear = np.flatnonzero(np.abs(change) > 3 * sd)
    if clear.size:
        k = clear[np.argmax(np.abs(change[clear]) / sd[clear])]
        text += (
            f"; mode {k + 1} moves from {f0[k]:.2f} to {f1[k]:.2f} Hz and its damping from "
            f"{100 * zeta0[k]:.1f} to {100 * zeta1[k]:.1f} %"
        )
    return text + "."


def _difference(a: Frf, b: Frf, band_hz: tuple[float, float]) -> float:
    """Relative difference of two FRFs beyond their scatter."""
    low = max(band_hz[0], a.usable_band_hz[0], b.usable_band_hz[0])
    high = min(band_hz[1], a.usable_band_hz[1], b.usable_band_hz[1])
    lines = (a.frequency_hz >= low) & (a.frequency_hz <= high)
    both = np.flatnonzero(a.measured & b.measured)
    if a.frequency_hz.shape != b.frequency_hz.shape or not lines.any() or not both.size:
        return 0.0
    ha, hb = a.accelerance[:, both][..., lines], b.accelerance[:, both][..., lines]
    noise = a.variance[:, both][..., lines] + b.variance[:, both][..., lines]
    square = np.abs(ha - hb) ** 2
    beyond = max(0.0, float(np.sum(square - noise)) / float(np.sum(np.abs(ha * hb))))
    return float(np.sqrt(beyond))


def _chance(
    groups: tuple[tuple[Hit, ...], ...], band_hz: tuple[float, float], window_rate_1_s: float
) -> float | None:
    """That hits, which miss as hands do, differ so much from level to level; None: no repeats."""
    hits = [hit for group in groups for hit in group]
    level = np.array([number for number, group in enumerate(groups) for _ in group])
    spectra = transform(tuple(hits), band_hz, 0.0, window_rate_1_s)
    f = spectra.frequency_hz
    lines = (f >= band_hz[0]) & (f <= band_hz[1])
    frfs = np.array([(s.response / s.force)[:, lines].ravel() for s in spectra.hits])
    axes = np.array([hit.axis_index for hit in hits])
    rng, possible, measured, shared = np.random.default_rng(0), 1.0, 0.0, np.zeros(SHARED_OUT)
    for axis in set(axes.tolist()):
        own = axes == axis
        if not 1 < len(set(level[own].tolist())) < own.sum():
            continue
        across = [frfs[axes == other].mean(axis=0) for other in set(axes.tolist()) - {axis}]
        off = frfs[own] - frfs[own].mean(axis=0)
        seen = untilted(off, np.array(across)) if across else off
        possible *= ways(level[own])
        real, random = between(seen.view(float), level[own], SHARED_OUT, rng)
        measured, shared = measured + real, shared + random
    # Of a sum as large as that measured, from those shared out at random
    larger = int(np.count_nonzero(shared >= measured - 1e-9))
    return (1 + larger) / (1 + SHARED_OUT) if 1 / possible <= CHANCE else None


def _level(
    hits: tuple[Hit, ...], frf: Frf, modal: ModalModel, band_hz: tuple[float, float]
) -> ForceLevel:
    """The pose's modes refined on one level's FRF."""
    force = float(np.mean([hit.pulse.peak_n for hit in hits]))
    try:
        found = estimate_modes(frf, band_hz).modes
    except RefusedError:
        found = ()
    own = []
    for mode in modal.modes:
        # The same mode: within these in log frequency and MAC
        near = [
            other for other in found
            if abs(np.log(other.frequency_hz / mode.frequency_hz)) < 0.1
            and mac(other.shape, mode.shape) > 0.5
        ]  # fmt: skip
        apart = [abs(other.frequency_hz - mode.frequency_hz) for other in near]
        own.append(near[int(np.argmin(apart))] if near else None)
    told = ("frequency_hz", "frequency_sd_hz", "damping_ratio", "damping_sd")
    rows = (tuple(getattr(m, name) if m else None for m in own) for name in told)
    return ForceLevel(force, len(hits), *rows)


def ways(labels: np.ndarray) -> float:
    """Ways to share members out among the groups `labels` (n,) that make a difference."""
    sizes = np.bincount(labels)
    sizes = sizes[sizes > 0]
    orders = prod(factorial(int(n)) for n in np.bincount(sizes))  # groups of equal size
    return factorial(len(labels)) / prod(factorial(int(n)) for n in sizes) / orders


def between(
    values: np.ndarray, labels: np.ndarray, draws: int, rng: np.random.Generator
) -> tuple[float, np.ndarray]:
    """n/2 ln of all scatter of values (n, m) over that within groups: as it is, and at random.

    Sums over independent sets of members say more.
    """
    off = values - values.mean(axis=0)
    gram = off @ off.T
    whole = max(float(np.trace(gram)), np.finfo(float).tiny)
    orders = rng.permuted(np.tile(np.arange(len(off)), (draws, 1)), axis=1)
    orders = np.concatenate([np.arange(len(off))[None], orders])
    within = np.full(len(orders), whole)
    for label in np.unique(labels):
        own = orders[:, labels == label]
        within -= gram[own[:, :, None], own[:, None, :]].sum(axis=(1, 2)) / own.shape[1]
    told = -len(off) / 2 * np.log(np.maximum(within, 1e-12 * whole) / whole)
    return float(told[0]), told[1:]
