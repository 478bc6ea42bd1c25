"""How well stiffnesses are known, as robot.toml states it, and what they have in common."""

import numpy as np
import pytest

from planner.dynamics.simulation import Simulation
from planner.effects.parameters import Priors, parametrise
from planner.errors import InputError
from planner.fit.identify import identify
from planner.measurement.nuisances import EXACT_HITS
from planner.proof.arms import KR10
from planner.proof.load import load_truth
from planner.robot.robot import Robot
from tests.support.measured_frfs import measured_frfs


def stated(folder, top="", block=""):
    """KR10 with lines at the top of robot.toml and in its first [[compliance]]."""
    path = KR10.write(folder)
    text = path.read_text().replace("[[compliance]]", f"[[compliance]]\n{block}", 1)
    path.write_text(f"{top}\n{text}")
    return Simulation(Robot.load(path))


def sds(simulation, priors):
    found = parametrise(simulation, priors).parameters
    return [p.log_sd for p in found if p.kind == "stiffness"]


def test_a_block_goes_before_the_robot_and_the_robot_before_what_is_assumed(tmp_path):
    simulation = stated(tmp_path, "stiffness_sd_percent = 20", "stiffness_sd_percent = 5")
    first, *others = sds(simulation, Priors())
    assert first == pytest.approx(np.log(1.05))
    assert others == pytest.approx([np.log(1.2)] * 5)
    damping = [p.log_sd for p in parametrise(simulation, Priors()).parameters[6:]]
    assert damping == pytest.approx([np.log(5.0)] * 6)
    name = parametrise(simulation, Priors()).parameters[0].name
    assert sds(simulation, Priors(bounds={name: (1e3, 1e6)}))[0] == pytest.approx(
        np.log(1e3) / np.sqrt(12)
    )


def test_springs_off_together_are_likelier_than_springs_off_apart(tmp_path):
    simulation = stated(tmp_path, "stiffness_sd_percent = 10\nstiffness_bias_sd_percent = 50")
    p = parametrise(simulation, Priors())
    own, shared = np.log(1.1), np.log(1.5)
    assert p.log_sd[:6] == pytest.approx([np.hypot(own, shared)] * 6)
    assert p.covariance[:6, :6] == pytest.approx(own**2 * np.eye(6) + shared**2)
    precision = np.linalg.inv(p.covariance)
    soft = np.array([-0.4] * 6 + [0.0] * 6)
    apart = soft * np.tile([1.0, -1.0], 6)
    assert 10 * (soft @ precision @ soft) < apart @ precision @ apart


@pytest.mark.parametrize("value", ["0.0", "-5.0", "nan", "1e4"])
def test_what_is_no_sd_is_refused(tmp_path, value):
    with pytest.raises(InputError, match=r"robot.toml: stiffness_bias_sd_percent"):
        stated(tmp_path / "a", f"stiffness_bias_sd_percent = {value}")
    with pytest.raises(InputError, match=r"number 1 \(joint_1\) stiffness_sd_percent"):
        stated(tmp_path / "b", block=f"stiffness_sd_percent = {value}")


@pytest.mark.parametrize(("bias", "expected"), [("", 1.0), ("stiffness_bias_sd_percent = 60", 0.6)])
def test_a_spring_that_was_not_seen_follows_the_others_where_they_share_a_bias(
    tmp_path, bias, expected
):
    """Joint 6 turns about the axis on which hammer and sensor sit; all are 0.6 as stiff."""
    path = KR10.write(tmp_path)
    text = path.read_text().replace('"tcp"', '"link_6"').replace('"sensor"', '"link_6"')
    path.write_text(f"stiffness_sd_percent = 10\n{bias}\n{text}")
    simulation, q = Simulation(Robot.load(path)), KR10.poses(3, seed=2)
    frfs = measured_frfs(load_truth(path).changed(0.6), q, np.linspace(5.0, 60.0, 60), 0.05)
    found = identify(
        frfs, q, simulation, Priors(), band_hz=(5.0, 60.0), tolerances=EXACT_HITS, extend=False
    ).identified
    spring = found.estimate("stiffness of joint_6 about z")
    assert spring.value / spring.prior_median == pytest.approx(expected, rel=0.1)
    seen = found.estimate("stiffness of joint_2 about z")
    assert seen.value / seen.prior_median == pytest.approx(0.6, rel=0.02)
