"""The second engine of concealed cases (planner/proof/tree) against independent sums."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

from planner.proof.tree import nonlinear
from planner.proof.tree.blueprint import assemble
from planner.proof.tree.case import make_case
from planner.proof.tree.engine import make
from planner.proof.tree.hits import Clock, draw_hits
from planner.proof.tree.laws import Spring
from planner.proof.tree.layouts import LAYOUTS
from planner.proof.tree.march import first_order
from planner.proof.tree.records import contour, linear_records, marched, shifted
from planner.proof.tree.spatial import inertia_of
from planner.proof.tree.stating import Truth, draw_poses, draw_robot, draw_truth


def _robot(kind: str = "arm6", seed: int = 3) -> tuple[Truth, np.ndarray]:
    rng = np.random.default_rng(seed)
    robot = draw_robot(rng, kind)
    return draw_truth(rng, robot), draw_poses(rng, robot, 2)


@pytest.mark.parametrize("kind", list(LAYOUTS))
def test_mass_and_gravity_are_second_differences_of_energy(kind: str) -> None:
    truth, poses = _robot(kind)
    plan = truth.plan(poses[0])
    system, tree = assemble(plan, poses[0])
    size, h = len(tree.names), 1e-4
    gravity = truth.robot.gravity

    def energy(x: np.ndarray) -> float:
        return tree.settle(x).potential(gravity)

    unit = np.eye(size) * h
    bent = np.array([[energy(a + b) - energy(a - b) - energy(b - a) + energy(-a - b) for b in unit]
                     for a in unit]) / (4 * h * h)  # fmt: skip
    moved = (
        [_where(tree, h * u) for u in np.eye(size)],
        [_where(tree, -h * u) for u in np.eye(size)],
    )
    rates = [
        [(a - b) / (2 * h) for a, b in zip(f, g, strict=True)] for f, g in zip(*moved, strict=True)
    ]
    mass = _kinetic(tree.settle(), rates)
    springs = np.diag([t.law.stiffness for t in system.ties])
    own = eigh(springs + bent, mass, eigvals_only=True)
    assert np.allclose(system.modes()[0], np.sqrt(own) / (2 * np.pi), rtol=1e-5)
    assert np.abs(bent - system.gravity).max() < 1e-4 * np.abs(system.gravity).max()
    weight = [(energy(-u) - energy(u)) / (2 * h) for u in unit]
    assert np.allclose(weight, list(system.weight.values()), atol=1e-5 * np.abs(weight).max())


def _where(tree: Any, x: np.ndarray) -> list[np.ndarray]:
    """Centres and turns of all bodies as (3, 4) arrays."""
    tree.settle(x)
    return [np.column_stack([tree.at(n, b.centre), tree.turns[n]]) for n, b, _ in tree.bodies]


def _kinetic(tree: Any, rates: list) -> np.ndarray:
    """Mass matrix from the bodies' rates of place and turn: m v.v + tr(R' S R')."""
    total = np.zeros((len(rates), len(rates)))
    for i, one in enumerate(rates):
        for j, other in enumerate(rates):
            for (_, body, _), a, b in zip(tree.bodies, one, other, strict=True):
                total[i, j] += body.mass * a[:, 0] @ b[:, 0]
                total[i, j] += np.trace(a[:, 1:] @ body.second @ b[:, 1:].T)
    return total


def test_a_bent_link_keeps_mass_centre_and_inertia() -> None:
    truth, poses = _robot()
    whole, _ = assemble(truth.plan(poses[0]), poses[0])
    plan = truth.plan(poses[0])
    plan.bends = {}
    straight, tree = assemble(plan, poses[0])
    gears = [i for i, name in enumerate(tree.names) if name.endswith("gear")]
    bent = [i for i, t in enumerate(whole.ties) if t.name.endswith("gear")]
    assert np.allclose(
        whole.mass[np.ix_(bent, bent)], straight.mass[np.ix_(gears, gears)], rtol=1e-9
    )
    assert np.trace(inertia_of(np.diag([1.0, 2, 3]))) == 12


def test_without_controllers_frfs_are_reciprocal_and_energy_falls() -> None:
    truth, poses = _robot("cobot6")
    system, _ = assemble(truth.plan(poses[0]), poses[0])
    s = 2j * np.pi * np.linspace(4, 90, 40)
    z = np.linalg.inv(system.dynamic_stiffness(s))
    assert np.allclose(z, np.swapaxes(z, 1, 2), rtol=1e-8, atol=1e-12 * np.abs(z).max())
    power = np.array(
        [np.linalg.eigvalsh((m - m.conj().T) / 2j) for m in system.dynamic_stiffness(s)]
    )
    assert power.min() > -1e-9 * power.max()
    small = system.reduced()
    assert np.linalg.eigvals(first_order(small, "joint_1:gear").a).real.max() < 0
    change = np.abs(small.frf(s) - system.frf(s))[:, :3, :3]
    assert np.sqrt(np.mean(change**2) / np.mean(np.abs(system.frf(s))[:, :3, :3] ** 2)) < 0.01


def test_a_loss_factor_is_even_over_the_band() -> None:
    s = 2j * np.pi * np.geomspace(3, 120, 60)
    law = Spring(1e6, 0.0, 0.04)
    factor = law(s).imag / law(s).real
    assert np.all(np.abs(factor / 0.04 - 1) < 0.12)
    assert law(np.array([2j * np.pi * 20])).real == pytest.approx(1e6, rel=1e-6)


def test_records_give_the_analytic_frf() -> None:
    truth, poses = _robot()
    clock = Clock(1024.0, 4096)
    hits = draw_hits(np.random.default_rng(0), 1, 100.0, clock.rate)[:3]
    system = assemble(truth.plan(poses[0]), poses[0])[0].reduced()
    s, sigma = contour(clock)
    band = (s.imag > 2 * np.pi * 4) & (s.imag < 2 * np.pi * 90)
    h = system.frf(s)
    both = linear_records(h, hits, clock), marched([system], hits, clock, "joint_2:gear", None)[0]
    for motions in both:
        for hit, motion in zip(hits, motions, strict=True):
            seen = shifted(motion.motion, sigma, clock)[:3] / shifted(motion.force, sigma, clock)
            true = (h @ hit.wrench)[:, :3].T
            assert np.abs(seen - true)[:, band].max() < 0.005 * np.abs(true[:, band]).max()
    # H1 on lines without a shift, of a record in which the answer dies away.
    damped = _damped(truth, poses[0])
    motion = linear_records(damped.frf(s), hits[:1], clock)[0]
    f, a = np.fft.rfft(motion.force), np.fft.rfft(motion.motion[:3])
    lines = 2j * np.pi * np.fft.rfftfreq(clock.samples, 1 / clock.rate)
    some = (lines.imag > 2 * np.pi * 4) & (lines.imag < 2 * np.pi * 90)
    true = (damped.frf(lines[some]) @ hits[0].wrench)[:, :3].T
    seen = (a * f.conj() / np.abs(f) ** 2)[:, some]
    assert np.sqrt(np.mean(np.abs(seen - true) ** 2) / np.mean(np.abs(true) ** 2)) < 0.005


def _damped(truth: Truth, q: np.ndarray) -> Any:
    plan = truth.plan(q)
    plan.gears = [Spring(g.stiffness, 4 * g.damping + 0.002 * g.stiffness) for g in plan.gears]
    return assemble(plan, q)[0].reduced()


LAWS = {
    "softening": lambda k, x, v: nonlinear.Softening(k, x / 2),
    "hardening": lambda k, x, v: nonlinear.Hardening(k, x / 2),
    "piecewise": lambda k, x, v: nonlinear.Piecewise(k, x / 3, 2.0),
    "backlash": lambda k, x, v: nonlinear.Backlash(k, x / 4, np.array(0.1 * x)),
    "coulomb": lambda k, x, v: nonlinear.Coulomb(0.2 * k * x, 0.1 * v),
    "dahl": lambda k, x, v: nonlinear.Dahl(0.1 * k * x, 0.5 * k),
}


@pytest.mark.parametrize("name", list(LAWS))
def test_half_the_step_gives_the_same_nonlinear_record(name: str) -> None:
    truth, poses = _robot("palletiser4")
    clock = Clock(800.0, 640)
    hits = draw_hits(np.random.default_rng(0), 1, 100.0, clock.rate)[:3]
    system = assemble(truth.plan(poses[0]), poses[0])[0].reduced()
    linear, gear = marched([system], hits, clock, "joint_2:gear", None)
    top = np.abs(gear).max(axis=(0, 2))
    law = LAWS[name](truth.gears[1].stiffness, *top)
    coarse, fine = (marched([system], hits, clock, "joint_2:gear", law, n)[0] for n in (8, 16))
    for a, b, c in zip(coarse, fine, linear, strict=True):
        size = np.sqrt(np.mean(b.motion[:3] ** 2))
        assert np.sqrt(np.mean((a.motion - b.motion)[:3] ** 2)) < 0.005 * size
        assert np.sqrt(np.mean((c.motion - b.motion)[:3] ** 2)) > 0.001 * size


def test_marching_agrees_with_a_general_solver() -> None:
    truth, poses = _robot("scara4")
    system = assemble(truth.plan(poses[0]), poses[0])[0].reduced()
    clock = Clock(800.0, 320)
    hit = draw_hits(np.random.default_rng(1), 1, 50.0, clock.rate)[0]
    form = first_order(system, "joint_2:gear")
    _, gear = marched([system], [hit], clock, "joint_2:gear", None)
    top, rate = np.abs(gear).max(axis=(0, 2)) + 1e-12
    law = nonlinear.Hardening(truth.gears[1].stiffness, top / 2)
    _, seen = marched([system], [hit], clock, "joint_2:gear", law, 16)

    def slope(t: float, x: np.ndarray) -> np.ndarray:
        u = (t - clock.trigger) / hit.width
        lean = np.clip(u + hit.lean * u * (1 - u), 0, 1) if 0 < u < 1 else 0.0
        force = hit.peak * np.sin(np.pi * lean) ** hit.power
        torque, _, _ = law.torque(form.c[0] @ x, 0.0, 0.0, 0.0)
        return form.a @ x + form.b[:, :6] @ hit.wrench * force - form.b[:, 6] * torque

    times = np.arange(seen.shape[-1]) / (clock.rate * 16)
    answer = solve_ivp(slope, (0, times[-1]), np.zeros(len(form.a)), "RK45", times,
                       rtol=1e-8, atol=1e-13, max_step=1e-4)  # fmt: skip
    assert np.abs(form.c[0] @ answer.y - seen[0, 0]).max() < 0.003 * np.abs(seen[0, 0]).max()
    assert rate > 0


def test_a_case_is_written_whole(tmp_path: Path) -> None:
    made = make("sensor_gain", 7, tmp_path)
    assert [c.effect for c in made.concealed] == ["sensor_gain"]
    rows = (tmp_path / "recordings" / "recordings.csv").read_text(encoding="utf-8").splitlines()
    paths = list((tmp_path / "recordings" / "data").glob("*.uff"))
    assert len(paths) == len(rows) - 1
    sets = pyuff.UFF(str(paths[0])).read_sets()
    assert [s["ordinate_spec_data_type"] for s in sets] == [13, 12, 12, 12]
    assert [s["rsp_dir"] for s in sets[1:]] == [1, 2, 3]
    assert np.max(sets[0]["data"]) > 20 * np.std(sets[0]["data"][:20])


def test_a_seed_gives_the_same_case_again() -> None:
    one, two = make_case(11, "drift"), make_case(11, "drift")
    assert np.array_equal(one.motions[5].motion, two.motions[5].motion)
