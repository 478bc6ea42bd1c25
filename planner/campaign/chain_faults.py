"""What a measuring chain may do wrong, and how that is asked: signed axes, factors, filters."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations, permutations, product

import numpy as np

from planner.dynamics.gradient import laplace
from planner.frf.frf import Frf
from planner.measurement.nuisances import Tolerances
from planner.recording.points import AXES
from planner.words import significant

# Factors that are looked for, or their inverses: less is what springs and inertias leave open.
LEAST, MOST, STEP = np.log(1.5), np.log(3e6), 0.12
SCALE_SD = np.log(30.0)  # of the logarithm of a wrong factor
UNITS = {4.448: "lbf or N", 9.81: "g or m/s²", 39.37: "in/s² or m/s²", 1000.0: "mm or m"}
AS_UNIT = 0.2  # of the logarithm: as near a factor is told
BEYOND = 3.0  # sds, from which a factor or a turn is none that a sound chain has


@dataclass(frozen=True, eq=False)
class ChainFault:
    """What a chain shows is `matrix` (3, 3) times what it should, x, y, z being its channels.

    `scaled` are the channels that `factor` multiplies; () where axes or signs are exchanged.
    `flipped_hits` are axes along which the hammer hit against the direction that is stated;
    `order` along which axis those hits were that are listed as along x, y, z. Accelerations come
    `delay_s` late, are high-passed at `corner_hz` (AC coupling; forces are where it is negative),
    all channels fade by an exponential window of `window_rate_1_s` more than is known, and all
    frequencies are `time` times what they should be, as by a wrong sampling rate.
    """

    matrix: np.ndarray
    scaled: tuple[int, ...] = ()
    factor: float = 1.0
    flipped_hits: tuple[int, ...] = ()
    order: tuple[int, ...] = (0, 1, 2)
    delay_s: float = 0.0
    corner_hz: float = 0.0
    window_rate_1_s: float = 0.0
    time: float = 1.0

    def undone(self, frf: Frf) -> tuple[Frf, float]:
        """A tool's FRF (3, c, F) as a sound chain would show it.

        And ln of the Jacobian of one complex value of every column.
        """
        inverse, frequency_hz = np.linalg.inv(self.matrix), frf.frequency_hz / self.time
        s = laplace(frequency_hz, frf.exponential_rate_1_s)[0]
        passed = 1 + 2 * np.pi * abs(self.corner_hz) / s
        filtered = np.exp(s * self.delay_s) * passed ** np.sign(self.corner_hz)
        shown = np.einsum("ij,jcf->icf", inverse, frf.accelerance) * filtered
        for axis in self.flipped_hits:
            shown[:, axis::3] *= -1
        size = np.abs(filtered)
        variance = np.einsum("ij,jcf->icf", inverse**2, frf.variance) * size**2
        listed = np.argsort(self.order) + 3 * np.arange(shown.shape[1] // 3)[:, None]
        shown, variance = shown[:, listed.ravel()], variance[:, listed.ravel()]
        rate = frf.exponential_rate_1_s / self.time + self.window_rate_1_s
        volume = np.log(np.abs(np.linalg.det(inverse))) + 3 * np.mean(np.log(size))
        changed = replace(
            frf, frequency_hz=frequency_hz, accelerance=shown, variance=variance,
            exponential_rate_1_s=rate,
        )  # fmt: skip
        return changed, 2 * float(volume)

    @property
    def asked(self) -> str:
        """What looks wrong, as a question."""
        if self.flipped_hits:
            axes = " and ".join(AXES[i] for i in self.flipped_hits)
            return f"hits along {axes} look struck the other way than they are listed?"
        wrong = [f"{AXES[i]} along {AXES[at]}" for i, at in enumerate(self.order) if i != at]
        if wrong:
            return f"hits look listed along wrong axes: were those along {', '.join(wrong)}?"
        if self.scaled:
            return self._of_scale
        if self.delay_s or self.corner_hz or self.window_rate_1_s or self.time != 1:
            return self._of_filter
        exchanged = np.array_equal(np.abs(self.matrix).sum(axis=1), np.ones(3))
        return self._of_axes if exchanged else self._of_turn

    @property
    def _of_scale(self) -> str:
        size = float(np.exp(abs(np.log(self.factor))))
        unit = min(UNITS, key=lambda known: abs(np.log(size / known)))
        near = abs(np.log(size / unit)) < AS_UNIT
        times = f"{significant(unit, 3)} times" if near else f"about {significant(size, 2)} times"
        way, other = ("large", "small") if self.factor > 1 else ("small", "large")
        whole = len(self.scaled) == len(AXES)
        what = "accelerations are" if whole else f"channel {AXES[self.scaled[0]]} is"
        if np.log(size) < LEAST:  # no unit is so near another
            force = f", or forces {other} by as much" if whole else ""
            percent = 100 * abs(self.factor - 1)
            return f"{what} {percent:.0f} % too {way}: another sensitivity, a loose sensor{force}?"
        known = f" ({UNITS[unit]})" if near else ""
        force = f", or forces too {other}" if whole else ""
        load = ", or a tool that robot.toml lacks" if whole and self.factor < 1 else ""
        return f"{what} {times} too {way}: units or sensitivity{known}{force}{load}?"

    @property
    def _of_filter(self) -> str:
        if self.delay_s:
            both = ("accelerations", "forces")[:: 1 if self.delay_s > 0 else -1]
            late = f"{both[0]} come {1e3 * abs(self.delay_s):.2g} ms after {both[1]}"
            return f"{late}: another trigger, filter or input?"
        if self.corner_hz:
            what = "accelerations" if self.corner_hz > 0 else "forces"
            passed = f"{what} lack what is slow, as by a high-pass at {abs(self.corner_hz):.2g} Hz"
            return f"{passed}: is that input AC-coupled?"
        if self.time != 1:
            way = "high" if self.time > 1 else "low"
            return (
                f"all frequencies are {100 * abs(self.time - 1):.2g} % too {way} by one factor: is "
                f"the sampling rate right, or has all of the robot changed?"
            )
        if self.window_rate_1_s > 0:
            faster = f"all decays look {self.window_rate_1_s:.2g} 1/s faster"
            return f"{faster}: does the analyser lay an exponential window over these records?"
        slower = f"all decays look {-self.window_rate_1_s:.2g} 1/s slower"
        return f"{slower}: was the analyser's exponential window off, or another one?"

    @property
    def _of_turn(self) -> str:
        from scipy.spatial.transform import Rotation  # 0.4 s, which good hits do not need

        turn = Rotation.from_matrix(self.matrix).as_rotvec(degrees=True)
        axis, degrees = AXES[int(np.argmax(np.abs(turn)))], np.linalg.norm(turn)
        return (
            f"the sensor looks turned by {degrees:.0f}° since, mostly about its {axis} axis: was "
            f"it taken off, is it loose, or does a wrist joint stand so far from the angle stated?"
        )

    @property
    def _of_axes(self) -> str:
        order, signs = np.argmax(np.abs(self.matrix), axis=1), self.matrix.sum(axis=1)
        wrong = [i for i in range(3) if order[i] != i or signs[i] < 0]
        reads = " and ".join(
            f"{AXES[i]} reads what {'−' if signs[i] < 0 else ''}{AXES[order[i]]} should"
            for i in wrong
        )
        straight = bool(np.all(order == np.arange(3)))
        if straight and len(wrong) == len(AXES):
            return "the tool answers against every hit: has the force, or all axes, a wrong sign?"
        if straight and len(wrong) == 1:
            axis = AXES[wrong[0]]
            return (
                f"{axis} answers against hits along {axis}: has channel {axis} a wrong sign, or "
                f"were they hit the other way?"
            )
        if np.linalg.det(self.matrix) < 0:
            return f"the sensor's axes look exchanged: {reads}?"
        turn = np.arccos((np.trace(self.matrix) - 1) / 2)
        return f"the sensor looks turned by {np.rad2deg(turn):.0f}°: {reads}?"


NONE = ChainFault(np.eye(3))


def _times(channels: tuple[int, ...], factor: float) -> ChainFault:
    diagonal = np.ones(3)
    diagonal[list(channels)] = factor
    return ChainFault(np.diag(diagonal), channels, factor)


def possible(shown: np.ndarray, within: Tolerances, sure: bool) -> Iterator[ChainFault]:
    """All that may be wrong, where hits show `shown` (3, 3) times what is expected of them.

    `within` are the tolerances of a sound chain. Unless `sure`, springs and inertias that few poses
    leave open may well bring a small factor, too.
    """
    yield from (*TURNED, *AGAINST, *EXCHANGED)
    least = BEYOND * np.hypot(within.gain, within.force_gain) if sure else LEAST
    for channels in CHANNELS:
        factor = float(np.median(np.diag(shown)[list(channels)]))
        if factor > 0 and abs(np.log(factor)) > least:
            yield _times(channels, factor)
    left, _, right = np.linalg.svd(shown)
    rotation = left @ right
    turn = np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1, 1))
    if np.linalg.det(rotation) > 0 and turn > BEYOND * within.across:
        yield ChainFault(rotation)


# What one number does to all channels, in units of what a sound chain has or no one would see.
FILTERS: tuple[Callable[[float], ChainFault], ...] = (
    lambda by: ChainFault(np.eye(3), delay_s=by * Tolerances().delay_s),
    lambda by: ChainFault(np.eye(3), corner_hz=0.1 * by),
    lambda by: ChainFault(np.eye(3), window_rate_1_s=0.1 * by),
    lambda by: ChainFault(np.eye(3), time=1 + 0.002 * by),
)
TURNED = tuple(  # all 47 ways to exchange axes and signs
    ChainFault(np.diag(signs) @ np.eye(3)[list(order)])
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3))
)[1:]
AGAINST = tuple(
    ChainFault(np.eye(3), flipped_hits=s) for n in (1, 2) for s in combinations(range(3), n)
)
EXCHANGED = tuple(ChainFault(np.eye(3), order=order) for order in permutations(range(3)))[1:]
CHANNELS = (0, 1, 2), (0,), (1,), (2,)  # that have one factor
LARGE = np.exp(np.arange(LEAST, MOST, STEP))
SCALED = tuple(
    tuple(_times(channels, float(factor)) for factor in (*(1 / LARGE), *LARGE))
    for channels in CHANNELS
)


def log_prior(family: tuple[ChainFault, ...]) -> np.ndarray:
    """Of the factors (n,) of one family, which have probability 1 together but for the least."""
    off = np.log([fault.factor for fault in family]) / SCALE_SD
    return np.log(STEP / (SCALE_SD * np.sqrt(2 * np.pi))) - off**2 / 2
