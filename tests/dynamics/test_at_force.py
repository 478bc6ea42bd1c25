"""Joints that are not linear, against their time integration by an independent engine."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from planner.dynamics.at_force import (
    accelerance_at_force,
    change_at_force,
    measured_at_force,
    modes_at_force,
)
from planner.dynamics.simulation import Simulation
from planner.proof.arms import KR10, in_a_cell
from planner.proof.deviation import Deviation
from planner.proof.fault_injection import InjectedFaults
from planner.proof.laws import Backlash, Friction, Hardening, JointLaw
from planner.proof.load import load_truth
from planner.proof.nonlinear import HitPose, Port, respond
from planner.proof.scene import Scene
from planner.robot.robot import Robot

JOINT, PEAK, RATE_HZ, RECORD_S = "joint_2", KR10.peak_n, 6400.0, 5.12
EXACT = Deviation(0, stiffness=0, damping=0, inertia=0, com_m=0)
# Of a joint's stiffness and its angle under a middling hit.
LAWS: dict[str, Callable[[float, float], JointLaw]] = {
    "hardening": lambda k, angle: Hardening(0.8 * k, 0.5 * angle),
    "softening": lambda k, angle: Hardening(-0.4 * k, 0.5 * angle),
    "friction": lambda k, angle: Friction(0.5 * k, 0.1 * k * angle),
    "backlash": lambda k, angle: Backlash(0.5 * k, 0.3 * angle),
}


@dataclass(frozen=True, eq=False)
class Bent:
    """A robot with a law, as the engine has it and as the simulation reads it; q (1, 6) in rad."""

    simulation: Simulation
    law: JointLaw
    truth: object
    q: np.ndarray

    @classmethod
    def of(cls, kind: str, folder: Path) -> "Bent":
        arm, rng = in_a_cell("kr10"), np.random.default_rng(3)
        toml, q = arm.write(folder, 1), arm.drawn(1, rng)
        truth = load_truth(toml, EXACT)
        scene = Scene(arm, truth, 1, q, PEAK, InjectedFaults(EXACT), rng)
        law = LAWS[kind](scene.stiffness(JOINT), scene.angle(JOINT))
        size, second = (abs(v) for v in vars(law).values())
        bend = "coulomb_torque_n_m" if kind == "friction" else "angle_rad"
        toml.write_text(
            f'{toml.read_text()}\n[[law]]\njoint = "{JOINT}"\nkind = "{kind}"\n'
            f"stiffness_n_m_rad = {size}\n{bend} = {second}\n"
            f"[hammer]\npulse_ms = {1e3 * pulse().sum() / RATE_HZ}\n"
        )
        return cls(Simulation(Robot.load(toml)), law, truth, q)

    def measured(self, peak_n: float) -> tuple[np.ndarray, np.ndarray]:
        """Lines (F,) of the band in Hz, and FRFs (1, 3, 3, F) of hits by time integration."""
        force = np.tile(peak_n * pulse(), (3, 1))
        struck = HitPose(self.truth, self.q[0], force, np.eye(6)[:3])
        (answer,) = respond([struck], [Port(self.law, joint=JOINT)], 1 / RATE_HZ)
        hertz = np.fft.rfftfreq(force.shape[1], 1 / RATE_HZ)
        low, high = self.simulation.robot.config.band_hz
        used = (hertz >= low) & (hertz <= high)
        columns = np.fft.rfft(answer)[..., used] / np.fft.rfft(force)[:, None, used]
        return hertz[used], np.moveaxis(columns, 0, 1)[None]


def pulse() -> np.ndarray:
    """(T,) of another shape than the simulation's, and of its impulse."""
    t = np.arange(round(RECORD_S * RATE_HZ)) / RATE_HZ
    return np.sin(np.pi * np.clip((t - 0.01) / 0.008, 0, 1)) ** 1.5


@pytest.mark.parametrize("kind", LAWS)
def test_frfs_at_a_force_are_those_of_time_integration(tmp_path: Path, kind: str):
    bent = Bent.of(kind, tmp_path)
    for level in (0.3, 2.0):
        hertz, true = bent.measured(level * PEAK)
        force_n = np.array([level * PEAK])
        linear = bent.simulation.accelerance(bent.q, hertz)
        off = {
            "linear": linear,
            "linearised": accelerance_at_force(bent.simulation, bent.q, force_n, hertz),
            "in time": measured_at_force(bent.simulation, bent.q, force_n, hertz),
        }
        off = {name: np.linalg.norm(h - true) / np.linalg.norm(true) for name, h in off.items()}
        assert off["in time"] < 0.01
        assert off["linearised"] < 0.8 * off["linear"]
        np.testing.assert_allclose(
            change_at_force(bent.simulation, bent.q, force_n, hertz, False) + linear,
            accelerance_at_force(bent.simulation, bent.q, force_n, hertz),
        )


@pytest.mark.parametrize("kind", ["hardening", "friction"])
def test_a_mode_moves_with_the_force_as_the_peak_does(tmp_path: Path, kind: str):
    bent, found, seen = Bent.of(kind, tmp_path), [], []
    for level in (0.2, 2.5):
        hertz, true = bent.measured(level * PEAK)
        size = np.sqrt(np.sum(np.abs(true[0] / hertz**2) ** 2, axis=(0, 1)))
        first = modes_at_force(bent.simulation, bent.q, np.array([level * PEAK]), 1)
        found.append(first.frequency_hz[0, 0])
        near = np.abs(hertz / found[-1] - 1) < 0.25
        seen.append(hertz[near][np.argmax(size[near])])
    # The peak is that of the whole decay, the mode that of its stronger part: it moves farther.
    moved, peak = np.log(found[1] / found[0]), np.log(seen[1] / seen[0])
    assert 0.3 < peak / moved < 1
    assert found[0] == pytest.approx(seen[0], rel=0.02)
