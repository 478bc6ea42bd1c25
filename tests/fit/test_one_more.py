"""One effect more beside a fit, all else linear: its slopes are derivatives, its promises kept."""

import numpy as np
import pytest

from planner.dynamics.simulation import Simulation
from planner.effects.effect import Operator
from planner.effects.one_visit import of_one_visit
from planner.effects.parameters import CAD_INERTIAS
from planner.effects.table import EffectLibrary, diagnosed
from planner.fit.fitted import StructureFit, converged, settled, size_of
from planner.fit.gauss_newton import minimised
from planner.fit.one_more import OneMore
from planner.fit.search import Search
from planner.fit.structure import RobotPrior
from planner.measurement.nuisances import Tolerances
from planner.robot.robot import Robot
from tests.support.fitted_cases import everyday

LINES = 14
# A soft base, bending and a hose are there; each of these kinds beside what was found, and one from
# each way in which effects can act: springs, another prior of one, impedances, the chain, a pose.
KINDS = (
    "transverse_compliance", "joint_stiffness", "local_resonator", "added_mass", "ground_contact",
    "between_links", "angle_dependent_stiffness", "frequency_dependent_joint", "sensor_gain",
    "sensor_rotation", "channel_delay", "misread_angle", "other_tool", "touched",
)  # fmt: skip


@pytest.fixture(scope="module")
def search(tmp_path_factory) -> Search:
    case = everyday("arm of four", 9, tmp_path_factory.mktemp("case"))
    simulation = Simulation(Robot.load(case.toml))
    prior = RobotPrior(EffectLibrary.of(simulation, CAD_INERTIAS, diagnosed(simulation)))
    q = case.q[:3]
    last = diagnosed(simulation)
    read = of_one_visit(simulation.robot, q, ("P1", "P2", "P3"), last)
    return Search(prior, case.frfs[:3], q, case.band_hz, Tolerances(), readings=read)


@pytest.fixture(scope="module")
def base(search) -> StructureFit:
    """What is there, as it was found, settled on few lines."""
    known = search.found().remembered
    misfit, x = search.again(known, search.data(LINES), known.size)
    found = converged(settled(misfit, minimised(misfit, x, 20)))
    assert size_of(found) <= 0.008
    at = found.misfit.kept(found.at.x, found.at.own)
    return StructureFit(found.misfit, at, found.misfit.evidence(at))


def one_of(search: Search, base: StructureFit, kind: str) -> Operator:
    return next(e for e in search.free(base.structure) if e.kind == kind)


# By an angle they are as exact as changed inertias let them be (`test_one_visit`).
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "misread_angle"])
def test_slopes_are_derivatives(search, base, kind):
    more = OneMore(base, one_of(search, base, kind))
    own = more.numbers
    x = np.clip(own.mean + 0.1 * np.diag(own.precision) ** -0.5, own.least, own.most)
    at = more(x)
    gradient = at.gradient + own.precision @ (x - own.mean)
    steps = 1e-5 * np.diag(own.precision) ** -0.5
    apart = [
        (more(x + e).value - more(x - e).value) / (2 * step)
        for e, step in zip(np.diag(steps), steps, strict=True)
    ]
    np.testing.assert_allclose(gradient, apart, rtol=1e-3, atol=1e-4 * np.abs(gradient).max())


@pytest.mark.parametrize("kind", KINDS)
def test_what_it_promises_the_whole_fit_keeps(search, base, kind):
    """Near home all else is linear: going on from there hardly gains."""
    effect = one_of(search, base, kind)
    motions, gain = base.misfit.first_order(base.at.x, base.at.own)
    more = OneMore(base, effect)
    begun = more.begun(start.psi for start in effect.starts(motions, gain))
    own = min(begun, key=lambda own: minimised(more, own, 12).value)
    promised, there = minimised(more, own, 12).value, more.tried(own, 12).record
    misfit, x = search.again(there, base.misfit.data, there.size)
    reached = minimised(misfit, x, 12, own=there.own).value - base.at.value
    assert promised == pytest.approx(reached, abs=3.0, rel=0.2)
