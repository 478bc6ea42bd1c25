"""The pose, axis and forces of the hits that best discriminate between nonlinear laws of a joint.

Friction, play and a softening spring answer alike over a short range of force, and differ beyond.
What each would answer follows from its equivalent stiffness at the swing that the hit gives the
joint (describing function; Worden & Tomlinson 2001, chapter 3), found by iteration. As where laws
are fitted, the difference between two forces is compared: what else is wrong is the same in both.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.design.discrimination import DiscriminatingHit, expected_log_odds
from planner.design.frequency_posterior import AXES
from planner.diagnosis.laws.equivalent_stiffness import Receptances, receptances, system_of, waves
from planner.diagnosis.laws.law_at_joints import LawAtJoints, LawMisfit, Laws
from planner.diagnosis.laws.level_data import own_parameter
from planner.diagnosis.laws.starting_values import faded
from planner.diagnosis.linear.predict import misfit_at
from planner.diagnosis.thresholds import LAW_DIFFERENCE_ERROR, LAW_MODEL_ERROR, TIED

MOST_POSES = 60  # poses evaluated: each takes tens of milliseconds
FORCE_RATIO = 2.0  # least ratio of the two forces, so that they count as two levels
FORCE_LEVELS = 6  # forces evaluated, evenly in logarithms
SWING_ITERATIONS = 8  # between swing and stiffness
DIFFERENCE_STEP = 1e-3  # of finite differences in ν and in the logarithm of the joint's stiffness
LEAST_SWING_RAD = 1e-15  # a swing as small as none


@dataclass(frozen=True)
class DiscriminatingForces:
    """A pose and an axis to hit, once or more with each of two peak forces (N)."""

    hit: DiscriminatingHit
    force_n: tuple[float, float]


def undecided(laws: Laws) -> Laws:
    """Those of the laws that the recordings leave tied, as probable as they were.

    Not play of a gear that bears weight: how that goes with the swing, its pose says.
    """
    both = zip(laws.probability, laws.candidates, strict=True)
    tied = [i for i, (share, c) in enumerate(both) if share > TIED and not c.law.borne]
    return replace(
        laws,
        candidates=tuple(laws.candidates[i] for i in tied),
        probability=tuple(laws.probability[i] for i in tied),
    )


def best_forces(
    laws: Laws, weakest_n: float, hardest_n: float, q: np.ndarray
) -> DiscriminatingForces:
    """The hits that best separate laws, at one of MOST_POSES of q (n, dof) in rad.

    `weakest_n` and `hardest_n` are the peaks (N) of the hits so far: no harder ones are asked for,
    and the two forces differ by FORCE_RATIO at least, so that they count as two levels.
    """
    force = forces_n(weakest_n, hardest_n)
    last = len(q) - 1
    looked_at = np.unique(np.linspace(0, last, MOST_POSES).round().astype(int))
    gain = np.nan_to_num(law_separation(laws, q[looked_at], force))
    gain[:, :, force[:-1] > hardest_n / FORCE_RATIO] = 0.0
    row, axis, level = (int(i) for i in np.unravel_index(int(np.argmax(gain)), gain.shape))
    best = DiscriminatingHit(int(looked_at[row]), axis, float(gain[row, axis, level]))
    return DiscriminatingForces(best, (float(force[level]), float(force[-1])))


def forces_n(weakest_n: float, hardest_n: float) -> np.ndarray:
    """Forces (FORCE_LEVELS,) in N: as far below the weakest as a hammer goes well, none beyond."""
    return np.geomspace(weakest_n / 2, hardest_n, FORCE_LEVELS)


def law_separation(laws: Laws, q: np.ndarray, force_n: np.ndarray) -> np.ndarray:
    """Expected logarithm of the odds (n, 3, L − 1) that two hits give at q (n, dof) in rad.

    Along each tcp axis, with one of the peaks force_n (L,) in N, and with the last of them; 0
    where there is one law only.
    """
    q = np.atleast_2d(q)
    gain = np.zeros((len(q), AXES, len(force_n) - 1))
    if len(laws.candidates) < 2:
        return gain
    share = np.array(laws.probability) / np.sum(laws.probability)
    known = [_precision(laws, c) for c in laws.candidates]
    floor = np.median(laws.hit.variance[np.isfinite(laws.hit.variance)])
    quiet = floor * (laws.hit.peak_n / force_n) ** 2
    for place, row in enumerate(q):
        predicted = [_predicted(laws, c.law, row, force_n) for c in laws.candidates]
        for level in range(len(force_n) - 1):
            now = [(h[level] - h[-1], slope[level] - slope[-1]) for h, slope in predicted]
            scales = [
                _scale(h[level], h[-1], quiet[level] + quiet[-1], laws.temper) for h, _ in predicted
            ]
            gain[place, :, level] = expected_log_odds(now, scales, known, share)
    return gain


def accelerance(
    receptance: Receptances, law: LawAtJoints, hit_force: np.ndarray, share: np.ndarray
) -> np.ndarray:
    """FRFs (L, 3, 3, F) in m/s²/N of a system with a law at one of its joints.

    `hit_force` (F,) in N·s is the spectrum of a hit, `share` (L,) how many times as hard it is.
    """
    port = int(law.ports[0])
    own = receptance.port_port[:, port]
    driven = receptance.port_hit[:, port].T  # (3, F)
    course = hit_force[:, None] * waves(receptance.s)
    stiffer = np.zeros((len(share), AXES), dtype=complex)
    for _ in range(SWING_ITERATIONS):
        angle = driven / (1 + stiffer[..., None] * own)  # (L, 3, F) per N
        swing = share[:, None] * np.max(np.abs((angle @ course).real), axis=2)
        slow = faded(law.kind, np.maximum(swing, LEAST_SWING_RAD), float(law.a[0]))
        stiffer = 0.5 * (stiffer + law.k[0] * slow)
    angle = driven / (1 + stiffer[..., None] * own)
    through = np.moveaxis(receptance.sensor_port[:, :, port], 0, 1)  # (3, F)
    torque = (stiffer[..., None] * angle)[:, None]  # (L, 1, 3, F)
    return receptance.s**2 * (
        np.moveaxis(receptance.sensor_hit, 0, 2) - through[:, None, :] * torque
    )


def _scale(h: np.ndarray, hardest: np.ndarray, quiet: float, temper: float) -> np.ndarray:
    """What differences of FRFs (3, 3, F) weigh, as in `laws.level_data`."""
    error = (LAW_MODEL_ERROR * np.abs(h - hardest)) ** 2 + (LAW_DIFFERENCE_ERROR * np.abs(h)) ** 2
    return np.sqrt(2 / (temper * (quiet + error)))


def _predicted(
    laws: Laws, law: LawAtJoints, row: np.ndarray, force_n: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """FRFs (L, 3, 3, F) of a law at a pose, and slopes (L, 3, 3, 3, F) by ν and its own spring."""
    hit = laws.hit
    misfit = misfit_at(laws.problem, laws.plain.effect, row[None], hit.frequency_hz, hit.rate_1_s)
    there, s = replace(laws.plain, misfit=misfit), misfit.setting.s[0]
    stiffer = law.x.copy()
    stiffer[_own(laws, law)] += DIFFERENCE_STEP
    here, moved = (receptances(system_of(there, x), 0, s) for x in (law.x, stiffer))
    share = force_n / hit.peak_n
    h = accelerance(here, law, hit.force, share)
    near = [
        accelerance(here, replace(law, nu=law.nu + step[:, None]), hit.force, share)
        for step in DIFFERENCE_STEP * np.eye(2)
    ]
    near.append(accelerance(moved, law, hit.force, share))
    return h, np.stack([(one - h) / DIFFERENCE_STEP for one in near], axis=1)


def _own(laws: Laws, law: LawAtJoints) -> int:
    return own_parameter(laws.plain, int(system_of(laws.plain).blocks[law.ports[0]]))


def _precision(laws: Laws, candidate: LawMisfit) -> np.ndarray:
    """(3, 3) of ν and the own spring's logarithm, all else averaged out."""
    full = candidate.covariance(laws.temper)
    at = np.array([len(full) - 2, len(full) - 1, _own(laws, candidate.law)])
    return np.linalg.inv(full[np.ix_(at, at)])
