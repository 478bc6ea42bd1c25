"""How often good imports are asked about, and wrong poses, angles and chains are, and named.

`QUESTIONED` says how many robots are hit, `QUESTION_SEED` which ones come first; of every
`QUESTION_EACH`th of their kind (1) mistakes are tried, too.
"""

import os
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter
from threadpoolctl import threadpool_limits

from planner.campaign.alternatives import (
    Alternative,
    StatedHits,
    chain_faults,
    far_off_hits,
    flipped_signs,
    joint_offsets,
)
from planner.campaign.chain_mismatch import SpringDraws
from planner.campaign.poses_together import SURE, PosesTogether
from planner.dataset.measure import MeasuredPose
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS
from planner.effects.table import EffectLibrary
from planner.fit.expected import ExpectedFrfs
from planner.fit.fitted import FitRecord
from planner.fit.identified_robot import PLACED
from planner.fit.posterior import RobotPosterior
from planner.fit.search import Search
from planner.fit.structure import RobotPrior
from planner.frf.frf import Frf
from planner.measurement.nuisances import Tolerances
from planner.recording.joints import JointUnits
from planner.recording.records import Hit
from planner.robot.robot import Robot
from tests.support.chain_cases import fault, judged
from tests.support.fitted_cases import ARMS, POSES, Case, everyday, harder

CASES, SEED = int(os.environ.get("QUESTIONED", "100")), int(os.environ.get("QUESTION_SEED", "3000"))
MISREAD_DEG, EARLIER_DEG = 3.0, 5.0
EACH = int(os.environ.get("QUESTION_EACH", "1"))
CHAINS = (
    "× 1000", "÷ 9.81", "× 2", "a channel × 2", "wrong sign", "force's sign", "swapped axes",
    "turned by 90°",
)  # fmt: skip
FIRST = "first pose 5° off"
FILTERED = "2 ms late", "AC-coupled", "windowed"


def shown(frf: Frf, matrix: np.ndarray) -> Frf:
    """By a chain that is wrong by a matrix (3, 3)."""
    accelerance = np.einsum("ij,jcf->icf", matrix, frf.accelerance)
    return replace(
        frf, accelerance=accelerance, variance=np.einsum("ij,jcf->icf", matrix**2, frf.variance)
    )


def filtered(name: str, pose: MeasuredPose) -> Frf:
    """Of a pose's hits by a chain that does this to their records."""
    assert pose.one_hit_frf is not None
    return MeasuredPose(
        (), pose.band_hz, given=tuple(_filtered(name, h) for h in pose.hits)
    ).one_hit_frf


def _filtered(name: str, hit: Hit) -> Hit:
    a, rate = hit.acceleration_m_s2, hit.sampling_rate_hz
    if name == "2 ms late":
        late = round(2e-3 * rate)
        return replace(hit, acceleration_m_s2=np.pad(a, ((0, 0), (late, 0)))[:, : a.shape[1]])
    if name == "AC-coupled":
        b, c = butter(1, 2.0, "high", fs=rate)
        return replace(hit, acceleration_m_s2=lfilter(b, c, a, axis=1))
    after = np.maximum(np.arange(a.shape[1]) - np.argmax(np.abs(hit.force_n)), 0) / rate
    fading = np.exp(-3.0 * after)
    return replace(hit, acceleration_m_s2=a * fading, force_n=hit.force_n * fading)


def flipped(q: np.ndarray, joint: int) -> np.ndarray:
    """With the other sign of an angle."""
    return np.where(np.arange(len(q)) == joint, -q, q)


@dataclass(frozen=True, eq=False)
class Asker:
    """What is asked about, as the campaign does after some poses (0, 1, ...)."""

    draws: SpringDraws
    band_hz: tuple[float, float]
    poses: int
    joints: JointUnits
    expected: ExpectedFrfs | None = None
    known_q: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    known_frfs: tuple[Frf, ...] = ()

    def of_chain(self, q: np.ndarray, frf: Frf) -> str:
        """By the simulation alone."""
        sums = self.draws.sums(q, frf.within(self.band_hz))
        return "" if sums is None or judged(sums) is None else "chain"

    def asked(self, q: np.ndarray, frf: Frf, others: dict[str, np.ndarray]) -> str:
        """A pose, "readback", "earlier" and its number, "chain", "?" where nothing fits; "" where
        nothing is asked."""
        if self.expected is None:
            return self.of_chain(q, frf)
        frf = frf.within(self.band_hz)
        sure, placed = self.poses >= SURE, self.poses >= PLACED
        stated = StatedHits(self.expected, q, frf, placed)
        likely = [far_off_hits(self.expected, q)] if sure else []
        if stated.agree(likely):
            return ""
        mistakes = likely + [Alternative(there, "", name) for name, there in others.items()]
        if sure:
            angles = tuple(self.joints.shown(q))
            mistakes += flipped_signs(self.joints, angles)
            mistakes += joint_offsets(self.joints, self.expected, frf, angles)
        mistakes += chain_faults(self.expected, q, frf, sure)
        found = stated.best_alternative(mistakes)
        if found is None or found.about == "readback":
            every, frfs = np.vstack([self.known_q, q]), (*self.known_frfs, frf)
            posterior, none = self.expected.posterior, [()] * len(every)
            together = PosesTogether(posterior, self.band_hz, self.joints, every, frfs)
            wrong = together.wrong(none)
            if wrong is not None:
                return f"earlier {wrong[0]}"
        if found is not None:
            return found.pose or found.about
        if not stated.impossible:
            return ""
        return "?" if sure else self.of_chain(q, frf)


def answers(
    case: Case, rng: np.random.Generator, mistaken: bool
) -> list[dict[str, tuple[str, str]]]:
    """Of each pose, by what is wrong: what is asked, and what is so; of the first its chain."""
    simulation = Simulation(Robot.load(case.toml))
    tolerances = Tolerances.of(simulation.robot.config, simulation.robot.joints.slides)
    prior, warm = RobotPrior(EffectLibrary.of(simulation, CAD_INERTIAS)), None
    first = Asker(SpringDraws(simulation, tolerances), case.band_hz, 0, simulation.robot.joints)
    poses, out = {f"P{k}": q for k, q in enumerate(case.q)}, []

    def after(q: np.ndarray, warm: FitRecord | None) -> tuple[Asker, FitRecord]:
        n, frfs = len(q), tuple(f.within(case.band_hz) for f in case.frfs[: len(q)])
        fit = Search(prior, case.frfs[:n], q, case.band_hz, tolerances).found(warm)
        expected = ExpectedFrfs(RobotPosterior.of(fit), case.band_hz)
        known = replace(first, poses=n, expected=expected, known_q=q, known_frfs=frfs)
        return known, fit.remembered

    wrong, bent = case.q.copy(), None
    wrong[0] += np.deg2rad(EARLIER_DEG) * np.eye(wrong.shape[1])[rng.integers(1, wrong.shape[1])]
    for n, (q, frf) in enumerate(zip(case.q, case.frfs, strict=True)):
        ask, true = first, f"P{(n + 1) % len(case.q)}"
        others = {name: there for name, there in poses.items() if name != f"P{n}"}
        one, chains = {}, CHAINS if mistaken else ()
        if n:
            ask, warm = after(case.q[:n], warm)
        if n and mistaken:
            strange = case.frfs[(n + 1) % len(case.q)]
            unlisted = {name: there for name, there in others.items() if name != true}
            typed = flipped(q, int(rng.integers(1, len(q))))
            misread = q + np.deg2rad(MISREAD_DEG) * np.eye(len(q))[int(rng.integers(1, len(q)))]
            against = replace(frf, accelerance=frf.accelerance * np.array([-1, 1, 1])[:, None])
            exchanged = [1, 0, 2]
            listed = replace(
                frf, accelerance=frf.accelerance[:, exchanged],
                variance=frf.variance[:, exchanged],
            )  # fmt: skip
            one = {
                "another pose": (ask.asked(q, strange, others), true),
                "unlisted pose": (ask.asked(q, strange, unlisted), "?"),
                "sign of an angle": (ask.asked(typed, frf, others), "readback"),
                "an angle 3° off": (ask.asked(misread, frf, others), "readback"),
                "x hit from behind": (ask.asked(q, against, others), "chain"),
                "x listed as y": (ask.asked(q, listed, others), "chain"),
            }
            bending, bent = after(wrong[:n], bent)
            if n >= SURE:
                one[FIRST] = (bending.asked(q, frf, others), "earlier 0")
                wrong_chain = {name: filtered(name, case.measured[n]) for name in FILTERED}
                one |= {name: (ask.asked(q, f, others), "chain") for name, f in wrong_chain.items()}
        one |= {
            name: (ask.asked(q, shown(frf, fault(name, rng)), others), "chain") for name in chains
        }
        out.append(one | {"right": (ask.asked(q, frf, others), "")})
    return out


@pytest.mark.slow
@pytest.mark.timeout(8 * 3600)
def test_how_often_is_asked(tmp_path):
    found: dict[str, list[list[tuple[str, str]]]] = {}
    for k in range(CASES):
        arm, make = [*ARMS][k % len(ARMS)], (everyday, harder)[k // len(ARMS) % 2]
        case, mistaken = make(arm, SEED + k, tmp_path / str(k)), (k // len(ARMS) + 1) % EACH == 0
        with threadpool_limits(1):
            told = answers(case, np.random.default_rng(SEED + k), mistaken)
        for name in told[-1]:
            # From one pose another structure may explain what fits nothing that is known.
            first = SURE if name in ("unlisted pose", FIRST, *FILTERED) else 0
            each = [one[name] for one in told[first:] if name in one]
            found.setdefault(name, []).append(each)
            print(k, arm, make.__name__, name, [answer for answer, _ in each], flush=True)
    print(f"\n{CASES} robots; asked of (named rightly) at poses ..., {POSES - 1}, {POSES}")
    rate = {}
    for name, robots in found.items():
        rate[name] = np.mean([[bool(told) for told, _ in robot] for robot in robots], axis=0)
        right = np.mean([[told == true for told, true in robot] for robot in robots], axis=0)
        both = zip(100 * rate[name], 100 * right, strict=True)
        cells = "".join(f"{a:7.1f} % ({b:5.1f} %)" for a, b in both)
        print(f"{name:>17}{cells:>{19 * POSES}}  of {len(robots)}")
    assert rate["right"].mean() <= 0.01
    assert all(rate[name].mean() >= 0.95 for name in ("another pose", "unlisted pose", *FILTERED))
    assert all(rate[name].min() >= 0.95 for name in CHAINS)
