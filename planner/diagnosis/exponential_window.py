"""An exponential window that nobody told of, from noise that fades. No model is needed.

Once the pulse is over the force channel holds noise alone, which stays as large as it is unless
the analyser has laid a window over it. Over the accelerations alone, most lay one: then their noise
at the end of the record is less than before the pulse.
"""

from collections.abc import Sequence

import numpy as np

from planner.diagnosis.finding import Finding
from planner.recording.records import Hit

LEAST_SAMPLES = 64
WINDOW_RATE_WIDTH_1_S = 5.0  # prior width of the rate
WINDOW_FASTEST_1_S = 50.0  # windows that fall faster leave nothing to look at
WINDOW_LEAST_1_S = 0.05  # slower ones change no damping that matters
# Of accelerations: samples before the pulse and hits at least, and the end of the record, by when
# what is fast has rung down; relative sd of the rate, as analysers begin their windows differently.
BEFORE, LEAST_HITS, END, UNSURE = 24, 4, 0.8, 0.03
LARGEST = 500.0  # exponent that a float holds
TRIED_1_S = 0.25 * 1.5 ** np.arange(13)  # rates up to the fastest, on which a window shows at all
NOISY = -0.3  # correlation of neighbours, above which it is no noise
MOST = 0.9  # share of hits whose noise fades by half the rate or more


def screen_window(hits: Sequence[Hit]) -> Finding | None:
    """`exponential_window` with its rate, where noise of force or accelerations fades."""
    return _by_force(hits) or _by_answer(hits)


def _by_force(hits: Sequence[Hit]) -> Finding | None:
    told = [part for part in map(_noise, hits) if part]

    def loss(rate: float) -> float:
        return -_log_likelihood(told, rate)

    if not told or loss(0.0) <= min(map(loss, TRIED_1_S.tolist())):
        return None
    from scipy.optimize import minimize_scalar  # 0.6 s, which good hits do not need

    found = minimize_scalar(loss, bounds=(-5.0, WINDOW_FASTEST_1_S), method="bounded")
    rate = float(found.x)
    curvature = (loss(rate + 0.01) - 2 * loss(rate) + loss(rate - 0.01)) / 1e-4
    sd = float(1 / np.sqrt(max(curvature, 1e-9)))
    evidence = (
        loss(0.0) - loss(rate) + float(np.log(np.sqrt(2 * np.pi) * sd / WINDOW_RATE_WIDTH_1_S))
    )
    if rate < WINDOW_LEAST_1_S or evidence < 0:
        return None
    return _finding("force", rate, sd, evidence)


def _by_answer(hits: Sequence[Hit]) -> Finding | None:
    """By how much less the noise of accelerations is at the end than before the pulse.

    What still rings there hides a window, and does not feign one.
    """
    told = [part for part in map(_fading, hits) if part]
    if len(told) < LEAST_HITS:
        return None
    rates = np.array([rate for rate, _ in told])
    # The middle hit: another may have been struck while the robot still rang.
    rate, spread = float(np.median(rates)), float(np.quantile(rates, 0.84) - np.median(rates))
    sampled = float(np.median([sd for _, sd in told]))
    sd = float(np.hypot(1.25 * max(spread, sampled) / np.sqrt(len(told)), UNSURE * rate))
    evidence = rate**2 / (2 * sd**2) + np.log(np.sqrt(2 * np.pi) * sd / WINDOW_RATE_WIDTH_1_S)
    if rate < WINDOW_LEAST_1_S or np.mean(rates > rate / 2) < MOST:
        return None
    return _finding("accelerations", rate, sd, float(evidence))


def _fading(hit: Hit) -> tuple[float, float] | None:
    """Rate (1/s), the least of all channels, by which noise fades in a hit, and its sd."""
    first, _ = hit.pulse.around(len(hit.force_n))
    steps = np.diff(hit.acceleration_m_s2, n=2)  # without what is slow: rumble, and modes
    before, end = steps[:, : max(first - 2, 0)], steps[:, int(END * steps.shape[1]) :]
    if before.shape[1] < BEFORE or end.shape[1] < BEFORE:
        return None
    if any(len(np.unique(row)) < row.size / 2 for row in (*before, *end)):
        return None  # blanked, or coarser than its noise
    if max(map(_alike, (*before, *end))) > NOISY:
        return None
    share = np.mean(end**2, axis=1) / np.mean(before**2, axis=1)
    t = (
        int(END * steps.shape[1]) + np.arange(end.shape[1]) - hit.pulse.peak
    ) / hit.sampling_rate_hz

    def left(rate: float) -> float:
        # Records of many seconds would overflow: what is beyond is as large as can be.
        return float(np.mean(np.exp(np.minimum(-2 * rate * t, LARGEST))) - share.max())

    if left(-WINDOW_FASTEST_1_S) < 0 or left(WINDOW_FASTEST_1_S) > 0:
        return None
    # Second differences are correlated with their neighbours: they tell a third as much.
    sd = np.sqrt(1.5 / before.shape[1] + 1.5 / end.shape[1]) / float(t.mean())
    low, high = -WINDOW_FASTEST_1_S, WINDOW_FASTEST_1_S
    while high - low > 1e-3 * sd:  # of a few records: bisection needs no SciPy
        middle = (low + high) / 2
        low, high = (middle, high) if left(middle) > 0 else (low, middle)
    return low, float(sd)


def _alike(steps: np.ndarray) -> float:
    """Correlation of neighbours: of second differences of white noise −2/3, of what rings above."""
    return float(np.mean(steps[1:] * steps[:-1]) / np.mean(steps**2))


def _finding(of: str, rate: float, sd: float, evidence: float) -> Finding:
    text = (
        f"The noise of the {of} fades by {rate:.3g} ± {sd:.1g} 1/s after the pulse: an "
        f"exponential window of {1 / rate:.3g} s is left in the recordings and adds as much "
        f"decay to every mode; correct for it."
    )
    parameters = {
        "time_constant": (1 / rate, sd / rate**2, "s"),
        "rate": (rate, sd, "1/s"),
    }
    return Finding("exponential_window", "sensor", evidence, parameters, text)


def _noise(hit: Hit) -> tuple[np.ndarray, np.ndarray] | None:
    """Times (n,) after the pulse in s, and what the force channel holds then."""
    _, last = hit.pulse.around(len(hit.force_n))
    rest = hit.force_n[last:]
    if len(rest) < LEAST_SAMPLES or len(np.unique(rest)) < LEAST_SAMPLES / 2:
        return None  # blanked by a force window, or coarser than its noise
    # Neighbours' differences: an offset, which a window would bend, is gone.
    steps = np.diff(rest)
    return (np.arange(len(steps)) + last - hit.pulse.peak) / hit.sampling_rate_hz, steps


def _log_likelihood(told: Sequence[tuple[np.ndarray, np.ndarray]], rate: float) -> float:
    """Of normal noise whose size falls as e^(−rate·t), each hit's own size profiled out."""
    total = 0.0
    for t, x in told:
        # Differences are correlated with their neighbours: they tell half as much.
        power = np.mean(x**2 * np.exp(2 * rate * t))
        total += 0.5 * (-len(x) / 2 * np.log(power) + rate * float(t.sum()))
    return total
