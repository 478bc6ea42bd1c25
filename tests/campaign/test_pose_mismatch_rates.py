"""How often good imports are asked about, and wrong poses, angles and chains are, and named.

`QUESTIONED` says how many robots are hit, `QUESTION_SEED` which ones come first; of every
`QUESTION_EACH`th of their kind (1) mistakes are tried, too.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pytest
from scipy.signal import butter, lfilter
from threadpoolctl import threadpool_limits

from planner.campaign.import_checks import Claim, question_about
from planner.campaign.model import Model
from planner.campaign.pose_mismatch import SURE
from planner.campaign.state import CampaignState
from planner.dataset.measure import MeasuredPose
from planner.recording.records import Hit
from tests.support.case_campaigns import CaseCampaign
from tests.support.chain_cases import fault
from tests.support.fitted_cases import ARMS, POSES, everyday, harder

CASES, SEED = int(os.environ.get("QUESTIONED", "100")), int(os.environ.get("QUESTION_SEED", "3000"))
MISREAD_DEG, EARLIER_DEG = 3.0, 5.0
EACH = int(os.environ.get("QUESTION_EACH", "1"))
CHAINS = (
    "× 1000", "÷ 9.81", "× 2", "a channel × 2", "wrong sign", "force's sign", "swapped axes",
    "turned by 90°",
)  # fmt: skip
FIRST = "first pose 5° off"
Change = Callable[[Hit], Hit]


def shown(matrix: np.ndarray) -> Change:
    """By a chain that is wrong by a matrix (3, 3)."""
    return lambda hit: replace(hit, acceleration_m_s2=matrix @ hit.acceleration_m_s2)


def late(hit: Hit) -> Hit:
    a, by = hit.acceleration_m_s2, round(2e-3 * hit.sampling_rate_hz)
    return replace(hit, acceleration_m_s2=np.pad(a, ((0, 0), (by, 0)))[:, : a.shape[1]])


def coupled(hit: Hit) -> Hit:
    b, c = butter(1, 2.0, "high", fs=hit.sampling_rate_hz)
    return replace(hit, acceleration_m_s2=lfilter(b, c, hit.acceleration_m_s2, axis=1))


def windowed(hit: Hit) -> Hit:
    after = np.maximum(np.arange(hit.force_n.size) - np.argmax(np.abs(hit.force_n)), 0)
    fading = np.exp(-3.0 * after / hit.sampling_rate_hz)
    return replace(
        hit, acceleration_m_s2=hit.acceleration_m_s2 * fading, force_n=hit.force_n * fading
    )


FILTERED: dict[str, Change] = {"2 ms late": late, "AC-coupled": coupled, "windowed": windowed}


def from_behind(hit: Hit) -> Hit:
    return replace(hit, axis=hit.axis.translate({ord("+"): "-"} if hit.axis[1] == "x" else {}))


def exchanged(hit: Hit) -> Hit:
    return replace(hit, axis=hit.axis.translate({ord("x"): "y", ord("y"): "x"}))


def off(q: np.ndarray, degrees: float, rng: np.random.Generator) -> np.ndarray:
    """With one angle, not the first, that is wrong by so much."""
    return q + np.deg2rad(degrees) * np.eye(len(q))[int(rng.integers(1, len(q)))]


def flipped(q: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """With the other sign of one angle."""
    return np.where(np.arange(len(q)) == int(rng.integers(1, len(q))), -q, q)


Told = dict[str, tuple[str, str]]  # what is asked, and what is so, by what is wrong


@dataclass(frozen=True, eq=False)
class Asker:
    """What is asked after the poses of a state."""

    campaign: CaseCampaign
    state: CampaignState

    @cached_property
    def model(self) -> Model:
        return self.campaign.model(self.state)

    def asked(
        self, pose: int, q: np.ndarray, change: Change | None = None,
        state: CampaignState | None = None, heavier: bool = False,
    ) -> str:  # fmt: skip
        """Of a pose's hits, said to be at q, by a chain that changes them: a pose, "readback",
        "earlier" and a pose, "chain", "?" where nothing fits; "" where nothing is asked."""
        case = self.campaign.case
        hits = (case.heavier if heavier else case.measured)[pose].hits
        hits = tuple(map(change, hits)) if change else hits
        measured = MeasuredPose((), case.band_hz, given=hits)
        angles = self.campaign.angles(q)
        told = question_about(Claim(self.model, state or self.state, "X", angles), measured)
        if told is None:
            return ""
        return f"earlier {told.fits}" if told.about == "earlier" else told.fits or told.about or "?"


def answers(campaign: CaseCampaign, rng: np.random.Generator, mistaken: bool) -> list[Told]:
    """Of each pose; where `mistaken`, of all that may be wrong with its hits, too."""
    case, out = campaign.case, []
    wrong_q = case.q.copy()
    wrong_q[0] = off(case.q[0], EARLIER_DEG, rng)
    for n, q in enumerate(case.q):
        ask = Asker(campaign, campaign.state(n, unlisted=[n]))
        one = {"right": (ask.asked(n, q), "")}
        if mistaken:
            one |= {k: (ask.asked(n, q, shown(fault(k, rng))), "chain") for k in CHAINS}
        if mistaken and n:
            one |= mistakes(ask, n, rng)
        if mistaken and n >= SURE:
            bent = Asker(campaign, campaign.state(n, wrong_q, [n]))
            one[FIRST] = (bent.asked(n, q), "earlier P0")
            one |= {name: (ask.asked(n, q, how), "chain") for name, how in FILTERED.items()}
            one["heavier tool"] = ask.asked(n, q, heavier=True), "chain"
        out.append(one)
    return out


def mistakes(ask: Asker, n: int, rng: np.random.Generator) -> Told:
    """Another pose, angles read wrongly, hits along another axis or direction than is said."""
    q = ask.campaign.case.q[n]
    other = (n + 1) % len(ask.campaign.case.q)
    found = {
        "another pose": (ask.asked(other, q), f"P{other}"),
        "sign of an angle": (ask.asked(n, flipped(q, rng)), "readback"),
        "an angle 3° off": (ask.asked(n, off(q, MISREAD_DEG, rng)), "readback"),
        "x hit from behind": (ask.asked(n, q, from_behind), "chain"),
        "x listed as y": (ask.asked(n, q, exchanged), "chain"),
    }
    if other > n:
        unlisted = ask.campaign.state(n, unlisted=[n, other])
        found["unlisted pose"] = (ask.asked(other, q, state=unlisted), "?")
    return found


@pytest.mark.slow
@pytest.mark.timeout(8 * 3600)
def test_how_often_is_asked(tmp_path):
    found: dict[str, dict[int, list[tuple[str, str]]]] = {}
    for k in range(CASES):
        arm, make = [*ARMS][k % len(ARMS)], (everyday, harder)[k // len(ARMS) % 2]
        case, mistaken = make(arm, SEED + k, tmp_path / str(k)), (k // len(ARMS) + 1) % EACH == 0
        with threadpool_limits(1):
            told = answers(CaseCampaign.of(case), np.random.default_rng(SEED + k), mistaken)
        for n, one in enumerate(told):
            # From one pose another structure may explain what fits nothing that is known.
            kept = {name: one[name] for name in one if name != "unlisted pose" or n >= SURE}
            for name, answer in kept.items():
                found.setdefault(name, {}).setdefault(n, []).append(answer)
            print(
                k, arm, make.__name__, f"P{n}", {name: kept[name][0] for name in kept}, flush=True
            )
    print(f"\n{CASES} robots; asked of (named rightly) at poses ..., {POSES - 1}, {POSES}")
    rate = {}
    for name, poses in found.items():
        rate[name] = np.array(
            [np.mean([bool(told) for told, _ in each]) for each in poses.values()]
        )
        right = [np.mean([told == true for told, true in each]) for each in poses.values()]
        both = zip(100 * rate[name], 100 * np.array(right), strict=True)
        cells = "".join(f"{a:7.1f} % ({b:5.1f} %)" for a, b in both)
        print(f"{name:>17}{cells:>{19 * POSES}}")
    assert rate["right"].mean() <= 0.01
    assert all(rate[name].mean() >= 0.95 for name in ("another pose", "unlisted pose", *FILTERED))
    assert all(rate[name].min() >= 0.95 for name in CHAINS)
