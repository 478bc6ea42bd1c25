"""Derivatives of FRFs by differences; joints that are not linear, beside another engine in time."""

import dataclasses
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
from planner.dynamics.gradient import Inertias, laplace, motion_slopes, moved, response
from planner.dynamics.simulation import Simulation
from planner.proof.arms import KR10, in_a_cell
from planner.proof.deviation import Deviation
from planner.proof.fault_injection import InjectedFaults
from planner.proof.laws import Backlash, Friction, Hardening, JointLaw
from planner.proof.load import load_truth
from planner.proof.nonlinear import HitPose, Port, respond
from planner.proof.scene import Scene
from planner.robot.robot import Robot
from planner.robot.virtual_joints import inertia_basis

LINES = np.linspace(6, 180, 25)
STEP = 1e-5


def simulated(tmp_path, per_joint=2, loss=0.0):
    path = KR10.write(tmp_path, per_joint)
    text = path.read_text().replace("damping =", f"loss_factor = {loss}\ndamping =")
    path.write_text(text)
    return Simulation(Robot.load(path))


def everything(tmp_path, loss, rate):
    simulation = simulated(tmp_path, loss=loss)
    q = KR10.poses(3)
    elastic = simulation.elastic
    basis = np.tile(inertia_basis(), (len(elastic.bodies), 1, 1, 1))
    inertias = Inertias(elastic.body_jacobians(q), basis)
    s = laplace(np.tile(LINES, (3, 1)), np.full(3, rate))
    return simulation, elastic.matrices(q), inertias, s


def mass_change(inertias, values):
    """Change (n, e, e) of M for values (B · 10,) of the bodies' parameters."""
    weighted = np.einsum("bpij,bp->bij", inertias.basis, values.reshape(inertias.basis.shape[:2]))
    jacobians = inertias.jacobians
    return np.sum(np.swapaxes(jacobians, 2, 3) @ weighted @ jacobians, axis=1)


@pytest.mark.parametrize(("loss", "rate"), [(0.0, 0.0), (0.08, 0.0), (0.0, 7.0)])
def test_springs_against_finite_differences(tmp_path, loss, rate):
    simulation, matrices, _, s = everything(tmp_path, loss, rate)
    elasticity = simulation.elasticity
    motion = moved(matrices, elasticity, s)
    h, gradient = motion.accelerance, motion_slopes(motion, elasticity)
    assert np.array_equal(h, response(matrices, elasticity, s))
    kinds = ("stiffness", "damping", "loss_factor")[: 3 if loss else 2]
    assert gradient.shape == (3, 12 * len(kinds), 3, 3, LINES.size)
    for k, kind in enumerate(kinds):
        for j in range(12):
            sides = []
            for step in (STEP, -STEP):
                values = getattr(elasticity, kind).copy()
                values[j] *= np.exp(step)
                sides.append(
                    response(matrices, dataclasses.replace(elasticity, **{kind: values}), s)
                )
            expected = (sides[0] - sides[1]) / (2 * STEP)
            found = gradient[:, 12 * k + j]
            assert np.abs(found - expected).max() < 1e-6 * np.abs(h).max()
            assert np.abs(found - expected).max() < 1e-3 * np.abs(found).max()


def test_inertias_against_finite_differences(tmp_path):
    """All ten parameters of every body; the mass matrix is linear in them, exactly."""
    simulation, matrices, inertias, s = everything(tmp_path, 0.0, 0.0)
    elasticity, nominal = simulation.elasticity, simulation.elastic.inertia
    motion = moved(matrices, elasticity, s)
    h, gradient = motion.accelerance, motion_slopes(motion, elasticity, inertias)
    whole = mass_change(inertias, nominal.ravel())
    np.testing.assert_allclose(whole, matrices.mass, atol=1e-12 * np.abs(matrices.mass).max())
    for j in range(nominal.size):
        step = np.zeros(nominal.size)
        step[j] = 1e-4 * (1e-2 + abs(nominal.flat[j]))
        sides = [
            response(dataclasses.replace(matrices, mass=matrices.mass + change), elasticity, s)
            for change in (mass_change(inertias, step), mass_change(inertias, -step))
        ]
        expected = (sides[0] - sides[1]) / (2 * step[j])
        found = gradient[:, 24 + j]
        assert np.abs(found - expected).max() < 1e-6 * max(np.abs(h).max(), np.abs(found).max())


def test_window_shifts_the_laplace_variable(tmp_path):
    """H at iω + rate is the transform of e^(−rate·t) h(t): checked through the poles."""
    simulation, matrices, _, s = everything(tmp_path, 0.0, 7.0)
    solved = simulation.poles(KR10.poses(3))
    expected = np.einsum(
        "nkij,nkf->nijf", solved.residues, 1 / (s[:, None] - solved.poles[..., None])
    )
    expected = expected * (s**2)[:, None, None]
    found = response(matrices, simulation.elasticity, s)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(found).max())


MORE = """
[[effects]]
effect = "soft floor and a joint whose stiffness goes with its angle"
at = ""
[[effects.compliance]]
joint = "base"
axis = [1, 0, 0]
stiffness = 1e6
damping = 1e2
[[effects.harmonic]]
joint = "joint_2"
order = 2
cosine = 4e4
sine = -3e4
"""


def test_slopes_by_joint_angles_are_those_of_the_whole_response(tmp_path):
    path = KR10.write(tmp_path, 2)
    path.write_text(f"geometric_stiffness = false\n{path.read_text()}{MORE}")
    simulation, q = Simulation(Robot.load(path)), KR10.poses(3)
    elastic, springs, s = simulation.elastic, simulation.elasticity, laplace(np.tile(LINES, (3, 1)))
    turned = moved(elastic.matrices(q, slopes=True), springs, s)
    for joint, turn in enumerate(STEP * np.eye(6)):
        there, back = (response(elastic.matrices(p), springs, s) for p in (q + turn, q - turn))
        change = (there - back) / (2 * STEP)
        largest = np.abs(change).max()
        assert largest > 0
        assert turned.by_angle[:, joint] == pytest.approx(change, abs=1e-6 * largest)


JOINT, PEAK, RATE_HZ, RECORD_S = "joint_2", KR10.peak_n, 6400.0, 5.12
EXACT = Deviation(0, stiffness=0, damping=0, inertia=0, com_m=0)
# Of a joint's stiffness and its angle under a middling hit.
LAWS: dict[str, Callable[[float, float], JointLaw]] = {
    "hardening": lambda k, angle: Hardening(0.8 * k, 0.5 * angle),
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
def test_frfs_and_modes_at_a_force_are_those_of_time_integration(tmp_path: Path, kind: str):
    bent, found, seen = Bent.of(kind, tmp_path), [], []
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
        size = np.sqrt(np.sum(np.abs(true[0] / hertz**2) ** 2, axis=(0, 1)))
        first = modes_at_force(bent.simulation, bent.q, force_n, 1)
        found.append(first.frequency_hz[0, 0])
        near = np.abs(hertz / found[-1] - 1) < 0.25
        seen.append(hertz[near][np.argmax(size[near])])
    if kind != "backlash":  # whose peak is no mode's
        # The peak is that of the whole decay, the mode that of its stronger part: it moves farther.
        moved, peak = np.log(found[1] / found[0]), np.log(seen[1] / seen[0])
        assert 0.3 < peak / moved < 1
        assert found[0] == pytest.approx(seen[0], rel=0.02)
