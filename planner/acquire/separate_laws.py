"""The pose, axis and force of the hit that best tells apart laws of a joint that is not linear.

Friction, play and a softening spring answer alike over a short range of force, and differ beyond.
What each would answer follows from its equivalent stiffness at the swing that the hit gives the
joint (describing function; Worden & Tomlinson 2001, chapter 3), found by iteration.
"""

from dataclasses import replace

import numpy as np

from planner.acquire.parameters import MODEL_ERROR
from planner.acquire.separate import AXES, expected_log_odds
from planner.diagnose.equivalent import System, receptances, system_of
from planner.diagnose.leveldata import own_parameter
from planner.diagnose.nonlinear import Candidate, Laws, covariance
from planner.diagnose.predict import misfit_at
from planner.diagnose.starts import faded

LINES = 96
LEVELS = 6  # forces that are looked at, evenly in logarithms
ROUNDS = 8  # of the iteration between swing and stiffness
STEP = 1e-3  # of finite differences in ν and in the logarithm of the joint's own stiffness
INSTANTS = np.linspace(0, 0.5, 97)  # s after the pulse in which the swing is largest


def forces_n(weakest_n: float, hardest_n: float) -> np.ndarray:
    """Forces (LEVELS,) in N: as far below the weakest as a hammer goes well, none beyond."""
    return np.geomspace(weakest_n / 2, hardest_n, LEVELS)


def law_separation(laws: Laws, q: np.ndarray, force_n: np.ndarray) -> np.ndarray:
    """Expected logarithm of the odds (n, 3, L) that a hit gives at q (n, dof) in rad.

    Along each tcp axis, with peaks force_n (L,) in N; 0 where there is one law only.
    """
    q = np.atleast_2d(q)
    gain = np.zeros((len(q), AXES, len(force_n)))
    if len(laws.candidates) < 2:
        return gain
    share = np.array(laws.probability) / np.sum(laws.probability)
    known = [_precision(laws, c) for c in laws.candidates]
    lines = np.linspace(laws.hit.frequency_hz[0], laws.hit.frequency_hz[-1], LINES)
    step = float(laws.hit.frequency_hz[1] - laws.hit.frequency_hz[0])
    each = 2 * max((lines[1] - lines[0]) / step, 1.0) / laws.temper
    floor = np.median(laws.hit.variance[np.isfinite(laws.hit.variance)])
    for place, row in enumerate(q):
        told = [_told(laws, c, row, lines, force_n) for c in laws.candidates]
        for level, peak in enumerate(force_n):
            now = [(h[level], slope[level]) for h, slope in told]
            quiet = floor * (laws.hit.peak_n / peak) ** 2
            scales = [np.sqrt(each / (quiet + (MODEL_ERROR * np.abs(h)) ** 2)) for h, _ in now]
            gain[place, :, level] = expected_log_odds(now, scales, known, share)
    return gain


def accelerance(
    system: System, law: Candidate, hit_force: np.ndarray, s: np.ndarray, share: np.ndarray
) -> np.ndarray:
    """FRFs (L, 3, 3, F) in m/s²/N at s (F,) of the system's only visit, with a law at a joint.

    `hit_force` (F,) in N·s is the spectrum of a hit, `share` (L,) how many times as hard it is.
    """
    found = receptances(system, 0, s)
    own = found.port_port[:, law.port]
    driven = found.port_hit[:, law.port].T  # (3, F)
    step = abs(float((s[1] - s[0]).imag)) / (2 * np.pi)
    waves = np.exp(np.outer(s, INSTANTS)) * (hit_force * 2 * step)[:, None]  # (F, t)
    stiffer = np.zeros((len(share), AXES), dtype=complex)
    for _ in range(ROUNDS):
        angle = driven / (1 + stiffer[..., None] * own)  # (L, 3, F) per N
        swing = share[:, None] * np.max(np.abs((angle @ waves).real), axis=2)
        stiffer = 0.5 * (stiffer + law.k * faded(law.law, swing, law.a))
    angle = driven / (1 + stiffer[..., None] * own)
    through = np.moveaxis(found.sensor_port[:, :, law.port], 0, 1)  # (3, F)
    torque = (stiffer[..., None] * angle)[:, None]  # (L, 1, 3, F)
    return s**2 * (np.moveaxis(found.sensor_hit, 0, 2) - through[:, None, :] * torque)


def _told(
    laws: Laws, law: Candidate, row: np.ndarray, lines: np.ndarray, force_n: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """FRFs (L, 3, 3, F) of a law at a pose, and slopes (L, 3, 3, 3, F) by ν and its own spring."""
    misfit = misfit_at(laws.problem, laws.plain.effect, row[None], lines)
    there = replace(laws.plain, misfit=misfit)
    s = 2j * np.pi * lines + laws.hit.rate_1_s
    force = np.interp(lines, laws.hit.frequency_hz, laws.hit.force)
    share = force_n / laws.hit.peak_n

    def at(nu: np.ndarray, stiffer: float) -> np.ndarray:
        x = law.x.copy()
        x[_own(laws, law)] += stiffer
        moved = replace(law, nu=law.nu + nu)
        return accelerance(system_of(there, x), moved, force, s, share)

    h = at(np.zeros(2), 0.0)
    near = [at(step, 0.0) for step in STEP * np.eye(2)] + [at(np.zeros(2), STEP)]
    return h, np.stack([(one - h) / STEP for one in near], axis=1)


def _own(laws: Laws, law: Candidate) -> int:
    return own_parameter(laws.plain, int(system_of(laws.plain).blocks[law.port]))


def _precision(laws: Laws, law: Candidate) -> np.ndarray:
    """(3, 3) of ν and the own spring's logarithm, all else averaged out."""
    full = covariance(law, laws.temper)
    at = np.array([len(full) - 2, len(full) - 1, _own(laws, law)])
    return np.linalg.inv(full[np.ix_(at, at)])
