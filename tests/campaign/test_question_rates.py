"""How often good imports are asked about, and wrong poses, angles and chains are, and named."""

import os
from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from planner.campaign.chain_faults import TURNED
from planner.campaign.question import SURE, Mistake, StatedHits, scaled
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS
from planner.effects.table import Repertoire
from planner.fit.expected import ExpectedFrfs
from planner.fit.posterior import RobotPosterior
from planner.fit.search import Search
from planner.fit.structure import RobotPrior
from planner.frf.frf import Frf
from planner.measurement.nuisances import Tolerances
from planner.robot.robot import Robot
from tests.support.fitted_cases import ARMS, Case, everyday, harder

CASES, SEED = int(os.environ.get("QUESTIONED", "100")), int(os.environ.get("QUESTION_SEED", "3000"))
CHAINS = {
    "× 1000": 1e3 * np.eye(3),
    "÷ 9.81": np.eye(3) / 9.81,
    "× 2": 2 * np.eye(3),
    "y × 2": np.diag([1.0, 2, 1]),
    "− z": np.diag([1.0, 1, -1]),
    "x, y swapped": np.eye(3)[[1, 0, 2]],
    "turned by 90°": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
}


def shown(frf: Frf, matrix: np.ndarray) -> Frf:
    """By a chain that is wrong by a matrix (3, 3)."""
    accelerance = np.einsum("ij,jcf->icf", matrix, frf.accelerance)
    return replace(
        frf, accelerance=accelerance, variance=np.einsum("ij,jcf->icf", matrix**2, frf.variance)
    )


def opposite(q: np.ndarray, joint: int) -> np.ndarray:
    """With the other sign of an angle."""
    return np.where(np.arange(len(q)) == joint, -q, q)


def asked(
    expected: ExpectedFrfs, q: np.ndarray, frf: Frf, others: dict[str, np.ndarray], sure: bool
) -> str:
    """What is asked about: a pose, "sign", "chain", "?" where nothing fits; "" where nothing is."""
    stated = StatedHits(expected, q, frf)
    if not stated.doubted:
        return ""
    mistakes = [Mistake(there, "", name) for name, there in others.items()]
    mistakes += [Mistake(opposite(q, i), "", about="sign") for i in range(len(q))]
    faults = (*TURNED, *scaled(expected.ratio(q, frf)))
    mistakes += [Mistake(q, "", about="chain", fault=fault) for fault in faults]
    found = stated.instead(mistakes)
    if found is None:
        return "?" if stated.impossible and sure else ""
    return found.pose or found.about


def answers(case: Case, rng: np.random.Generator) -> list[dict[str, tuple[str, str]]]:
    """Of each pose from the second on, by what is wrong: what is asked, and what is so."""
    simulation = Simulation(Robot.load(case.toml))
    tolerances = Tolerances.of(simulation.robot.config, simulation.robot.joints.slides)
    prior, warm, out = RobotPrior(Repertoire.of(simulation, CAD_INERTIAS)), None, []
    poses = {f"P{k}": q for k, q in enumerate(case.q)}
    for n in range(1, len(case.q)):
        fit = Search(prior, case.frfs[:n], case.q[:n], case.band_hz, tolerances).found(warm)
        expected, warm = ExpectedFrfs(RobotPosterior.of(fit), case.band_hz), fit.remembered
        q, frf, true = case.q[n], case.frfs[n], f"P{(n + 1) % len(case.q)}"
        others = {name: there for name, there in poses.items() if name != f"P{n}"}
        strange = case.frfs[(n + 1) % len(case.q)]
        unlisted = {name: there for name, there in others.items() if name != true}
        typed = opposite(q, int(rng.integers(1, len(q))))
        one = {
            "right": (asked(expected, q, frf, others, n >= SURE), ""),
            "another pose": (asked(expected, q, strange, others, n >= SURE), true),
            "unlisted pose": (asked(expected, q, strange, unlisted, n >= SURE), "?"),
            "sign of an angle": (asked(expected, typed, frf, others, n >= SURE), "sign"),
        }
        for name, matrix in CHAINS.items():
            one[name] = asked(expected, q, shown(frf, matrix), others, n >= SURE), "chain"
        out.append(one)
    return out


@pytest.mark.slow
@pytest.mark.timeout(4 * 3600)
def test_how_often_is_asked(tmp_path):
    found = []
    for k in range(CASES):
        arm, make = [*ARMS][k % len(ARMS)], (everyday, harder)[k // len(ARMS) % 2]
        case = make(arm, SEED + k, tmp_path / str(k))
        with threadpool_limits(1):
            found.append(answers(case, np.random.default_rng(SEED + k)))
        told = [
            [one["right"][0], one["another pose"], one["sign of an angle"]] for one in found[-1]
        ]
        print(k, arm, make.__name__, told, flush=True)
    print(f"\n{CASES} robots; asked of (named rightly) at poses 2, 3, ...")
    rate = {}
    for name in found[0][0]:
        each = np.array([[bool(one[name][0]) for one in robot] for robot in found])
        named = np.array([[one[name][0] == one[name][1] for one in robot] for robot in found])
        # From one pose another structure may explain what fits nothing that is known.
        rate[name] = float(each[:, SURE - 1 if name == "unlisted pose" else 0 :].mean())
        both = zip(100 * each.mean(axis=0), 100 * named.mean(axis=0), strict=True)
        print(f"{name:>17} " + "  ".join(f"{a:5.1f} % ({b:5.1f} %)" for a, b in both))
    assert rate["right"] <= 0.01
    assert all(rate[name] >= 0.95 for name in ("another pose", "unlisted pose", *CHAINS))
