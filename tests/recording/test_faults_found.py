"""Each fault that a hand or a chain makes, on MuJoCo's robots: found, and good hits are kept.

Nothing is shared with what screens them: the robots are MuJoCo's, numbers are drawn anew for each
group. A group is what is hit along one axis at one pose; of it one hit has the fault.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from planner.proof.deviation import Deviation
from planner.proof.hits import AXES, Hammer, largest_rms, noisy, pulse, sampled
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.recording.records import Hit
from planner.recording.repeats import screen_repeats
from planner.recording.screening import screen
from tests.support.robots import JOINTS_DEG, make_arm

REPEATS = 4


@dataclass(frozen=True, eq=False)
class Scene:
    """A pose of a true robot, a hammer that fits the band, and how the chain records."""

    truth: Truth
    q: np.ndarray
    band_hz: tuple[float, float]
    hammer: Hammer
    bits: int  # 0: floats
    full_scale: float  # over the largest sample of the group
    offset: float  # of the force at rest, over its peak
    rng: np.random.Generator

    @classmethod
    def draw(
        cls, truth: Truth, limits_deg: np.ndarray, band_hz: tuple[float, float], seed: list[int]
    ) -> "Scene":
        """Anything that a careful person may do; limits (dof, 2)."""
        rng = np.random.default_rng(seed)
        rate = band_hz[1] * rng.choice([5.12, 10.24, 20.48])
        hammer = Hammer(
            peak_n=float(np.exp(rng.uniform(np.log(40), np.log(1500)))),
            duration_s=float(rng.uniform(0.3, 0.7) / band_hz[1]),
            sampling_rate_hz=float(rate),
            record_s=float(rng.uniform(1.5, 3.0)),
            pretrigger_s=float(rng.uniform(0.03, 0.1)),
            noise=float(np.exp(rng.uniform(np.log(0.003), np.log(0.06)))),
            force_noise=float(np.exp(rng.uniform(np.log(1e-4), np.log(2e-3)))),
            oversampling=8,
        )
        q = np.deg2rad(rng.uniform(*limits_deg.T))
        bits, scale = int(rng.choice([0, 16, 24])), float(rng.uniform(1.1, 8.0))
        return cls(truth, q, band_hz, hammer, bits, scale, float(rng.normal(0, 0.003)), rng)

    def fine(self, force: np.ndarray, axis: str, tilted: bool = True) -> np.ndarray:
        """Exact response (3, n) to a force (n,) along a signed axis, as far as a hand holds it."""
        sense, index = (-1.0 if axis[0] == "-" else 1.0), AXES.index(axis[1])
        out = sense * self.truth.respond(self.q, force, index, self.hammer.step_s)
        if tilted:
            for other in {0, 1, 2} - {index}:
                tilt = self.rng.normal(0.0, np.deg2rad(2.0))
                out = out + tilt * self.truth.respond(self.q, force, other, self.hammer.step_s)
        return out

    def hit(
        self, axis: str, force: np.ndarray | None = None, hammer: Hammer | None = None,
        noise_m_s2: float | None = None, struck: str = "",
    ) -> Hit:  # fmt: skip
        """One recorded hit; `struck` is the axis that was hit indeed, `noise_m_s2` the chain's."""
        hammer = hammer or self.hammer
        force = pulse(hammer, self.rng) if force is None else force
        clean = sampled(axis, force, self.fine(force, struck or axis), hammer)
        if noise_m_s2 is not None:
            hammer = replace(hammer, noise=noise_m_s2 / largest_rms(clean))
        made = noisy(clean, hammer, self.rng)
        force_n = made.force_n + self.offset * hammer.peak_n
        return Hit(Path("hit"), axis, hammer.sampling_rate_hz, force_n, made.acceleration_m_s2)

    def group(self) -> list[Hit]:
        """REPEATS good hits along each axis, of one sign an axis."""
        signs = self.rng.choice(["+", "-"], 3)
        return [self.hit(s + a) for a, s in zip(AXES, signs, strict=True) for _ in range(REPEATS)]

    def recorded(self, hits: list[Hit]) -> tuple[Hit, ...]:
        """As the analyser's converters give them."""
        if not self.bits:
            return tuple(hits)
        tops = [self.full_scale * max(np.max(np.abs(h.force_n)) for h in hits)]
        tops.append(self.full_scale * max(np.max(np.abs(h.acceleration_m_s2)) for h in hits))
        steps = [top / 2 ** (self.bits - 1) for top in tops]
        return tuple(
            replace(h, force_n=np.round(h.force_n / steps[0]) * steps[0],
                    acceleration_m_s2=np.round(h.acceleration_m_s2 / steps[1]) * steps[1])
            for h in hits
        )  # fmt: skip


def clipped_force(scene: Scene, good: Hit) -> Hit:
    """The converter of the hammer saturates at 35 to 85 % of the peak: two samples or more."""
    second = np.sort(good.force_n)[-2] - good.pulse.offset_n
    share = min(scene.rng.uniform(0.35, 0.85), second / good.pulse.peak_n)
    return replace(
        good, force_n=np.minimum(good.force_n, good.pulse.offset_n + share * good.pulse.peak_n)
    )


def clipped_acceleration(scene: Scene, good: Hit) -> Hit:
    """The converter of the strongest channel saturates at 20 to 80 % of its largest sample.

    Three samples or more of one sign are cut: of fewer nobody could know.
    """
    samples = good.acceleration_m_s2.copy()
    channel = int(np.argmax(np.max(np.abs(samples), axis=1)))
    third = max(np.sort(samples[channel])[-3], -np.sort(samples[channel])[2])
    top = min(scene.rng.uniform(0.2, 0.8) * np.max(np.abs(samples[channel])), third)
    samples[channel] = np.clip(samples[channel], -top, top)
    return replace(good, acceleration_m_s2=samples)


def double(scene: Scene, good: Hit) -> Hit:
    """The hammer bounces: a second pulse of 20 to 100 % two to thirty pulses later."""
    first, h = pulse(scene.hammer, scene.rng), scene.hammer
    gap = scene.rng.uniform(2.0, 30.0) * h.duration_s
    shift = round(gap / h.step_s)
    second = scene.rng.uniform(0.2, 1.0) * np.concatenate([np.zeros(shift), first[:-shift]])
    return scene.hit(good.axis, first + second)


def weak(scene: Scene, good: Hit) -> Hit:
    """So faint that the response is below the chain's noise, which stays as it is."""
    noise = scene.hammer.noise * float(np.max(np.sqrt(np.mean(good.acceleration_m_s2**2, axis=1))))
    share = scene.hammer.noise * scene.rng.uniform(0.1, 0.6)
    made = scene.hit(good.axis, share * pulse(scene.hammer, scene.rng), noise_m_s2=noise)
    force = made.force_n - scene.offset * scene.hammer.peak_n
    extra = scene.hammer.force_noise * scene.hammer.peak_n * scene.rng.standard_normal(force.size)
    return replace(made, force_n=force + extra)


def soft(scene: Scene, good: Hit) -> Hit:
    """A soft tip: the pulse is so long that the band's end gets a hundredth of its start."""
    long = replace(scene.hammer, duration_s=scene.rng.uniform(2.4, 5.0) / scene.band_hz[1])
    return scene.hit(good.axis, pulse(long, scene.rng))


def wrong_axis(scene: Scene, good: Hit) -> Hit:
    """It was another axis than is said."""
    other = scene.rng.choice([a for a in AXES if a != good.axis[1]])
    return scene.hit(good.axis, struck=good.axis[0] + other)


def wrong_sign(scene: Scene, good: Hit) -> Hit:
    """It was from the other side than is said."""
    return scene.hit(good.axis, struck={"+": "-", "-": "+"}[good.axis[0]] + good.axis[1])


FAULTS: dict[str, Callable[[Scene, Hit], Hit]] = {
    "clipped hammer": clipped_force,
    "clipped accelerometer": clipped_acceleration,
    "double hit": double,
    "weak": weak,
    "soft": soft,
    "wrong axis": wrong_axis,
    "wrong sign": wrong_sign,
}


CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
LARGE = np.array([[-60, 60], [-110, -40], [40, 120], [-40, 40], [-80, 80], [-60, 60]])
FOUND, REFUSED = 0.97, 0.01  # at least, of each fault; at most, of good hits


def places(folder: Path) -> list[tuple[Path, np.ndarray, tuple[float, float]]]:
    """Robots with ranges of their joints and bands."""
    return [
        (make_arm(folder / "arm"), np.array(JOINTS_DEG), (5.0, 110.0)),
        (CAMPAIGNS / "kr240_busch2022" / "robot" / "robot.toml", LARGE, (4.0, 60.0)),
        (CAMPAIGNS / "kr240_plane" / "robot" / "robot.toml", LARGE, (4.0, 60.0)),
        (CAMPAIGNS / "kr10_birk2025" / "robot" / "robot_12p.toml", LARGE, (10.0, 150.0)),
    ]


def refused(hits: tuple[Hit, ...], band_hz: tuple[float, float]) -> list[str]:
    """Kind of the fault of each hit, empty for a good one, as an import judges them."""
    kinds = [next((f.kind for f in screen(hit, band_hz) if f.refuse), "") for hit in hits]
    good = [i for i, kind in enumerate(kinds) if not kind]
    for i, faults in zip(good, screen_repeats(tuple(hits[i] for i in good), band_hz), strict=True):
        kinds[i] = next((f.kind for f in faults if f.refuse), "")
    return kinds


def tried(folder: Path, count: int, seed: int) -> tuple[Counter[str], Counter[str], int]:
    """Faults found, good hits refused (alone: "", beside a fault: its name), and good hits."""
    robots = [
        (load_truth(path, Deviation(seed=s, stiffness=0.12, damping=0.1, inertia=0.04)), *more)
        for path, *more in places(folder)
        for s in range(3)
    ]
    found, lost, good = Counter[str](), Counter[str](), 0
    for k in range(count):
        truth, limits, band = robots[k % len(robots)]
        scene = Scene.draw(truth, limits, band, [seed, k])
        group = scene.group()
        good += len(group)
        lost[""] += sum(map(bool, refused(scene.recorded(group), band)))
        for name, make in FAULTS.items():
            i = int(scene.rng.integers(len(group)))
            hits = [*group[:i], make(scene, group[i]), *group[i + 1 :]]
            kinds = refused(scene.recorded(hits), band)
            found[name] += bool(kinds[i])
            lost[name] += sum(bool(kind) for j, kind in enumerate(kinds) if j != i)
    return found, lost, good


@pytest.mark.parametrize(
    "count", [4, pytest.param(500, marks=[pytest.mark.slow, pytest.mark.timeout(3600)])]
)
def test_faults_are_found_and_good_hits_are_kept(tmp_path, count):
    found, lost, good = tried(tmp_path, count, seed=4)
    print(f"\ngood hits refused {lost['']} of {good}")
    for name in FAULTS:
        print(f"{name}: found {found[name]} of {count}; good ones beside it refused {lost[name]}")
    least = FOUND if count == 500 else 0.75  # of few the share scatters
    assert {name: found[name] for name in FAULTS if found[name] < least * count} == {}
    assert lost[""] <= REFUSED * good
    assert all(lost[name] <= REFUSED * (good - count) for name in FAULTS)
