"""[[link]] of robot.toml: masses stated, guessed, believed, narrowed, handed on."""

from itertools import product

import numpy as np
import pytest

from planner.campaign.from_urdf import StatedMasses, guess
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS, INERTIAL, Priors, parametrise
from planner.errors import InputError
from planner.fit.result import Identification
from planner.fit.write_robot import write_robot
from planner.robot.default_properties import hull_solid
from planner.robot.link_bodies import guessed_masses, link_bodies
from planner.robot.robot import Robot
from tests.support.published import BOXES, DENSITY, published, robot_toml

LINK = """
[[link]]
link = "link_2"
mass_kg = 41.5
centre_m = [0.01, 0.02, 0.3]
inertia_kg_m2 = [2.0, 0.01, 0.02, 2.1, 0.03, 0.4]
sd_percent = 30.0
"""


def load(folder, more: str = "", **options) -> Robot:
    return Robot.load(robot_toml(folder / "robot.toml", published(folder, **options), more))


def test_what_robot_toml_states_stands_before_the_urdf(tmp_path):
    robot = load(tmp_path, LINK, inertias=True)
    inertia = robot.model.inertias[2]
    assert inertia.mass == 41.5
    np.testing.assert_allclose(inertia.lever, [0.01, 0.02, 0.3])
    np.testing.assert_allclose(
        inertia.inertia, [[2.0, 0.01, 0.02], [0.01, 2.1, 0.03], [0.02, 0.03, 0.4]]
    )
    (link,) = [body for body in link_bodies(robot) if body.name == "link_2"]
    assert (link.stated, link.sd_percent, link.guessed) == (True, 30.0, False)
    assert guessed_masses(link_bodies(robot)) == ""


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [('"link_2"', '"link_9"', "link_9"), ("41.5", "-1.0", "above 0 kg"),
     ("2.0, 0.01", "9.0, 0.01", "no body can have"), ("sd_percent = 30.0", "", ""),
     ("sd_percent = 30.0", "sd_percent = 0.0", "above 0"),
       ("centre_m = [0.01, 0.02, 0.3]", "", "all three"),
       ("sd_percent = 30.0", f"sd_percent = 30.0{LINK}", "earlier")],
)  # fmt: skip
def test_wrong_entries_are_told(old, new, words, tmp_path):
    if not words:
        assert load(tmp_path, LINK.replace(old, new)).config.link[0].sd_percent is None
        return
    with pytest.raises(InputError, match=words):
        load(tmp_path, LINK.replace(old, new))


def sds(robot: Robot, priors: Priors) -> dict[str, float]:
    """Prior sd of mass (kg) of each body."""
    p = parametrise(Simulation(robot), priors)
    mass = INERTIAL.index("mass")
    bodies = Simulation(robot).elastic.bodies
    return {body: float(p.inertia[b, mass, 0]) for b, body in enumerate(bodies)}


def test_the_stated_sd_is_the_prior_of_that_link_alone(tmp_path):
    stated = sds(load(tmp_path / "a", LINK, inertias=True), CAD_INERTIAS)
    plain = sds(load(tmp_path / "b", inertias=True), CAD_INERTIAS)
    assert stated["joint_2"] == pytest.approx(0.3 * 41.5)
    assert {k: v for k, v in stated.items() if k != "joint_2"} == pytest.approx(
        {k: v for k, v in plain.items() if k != "joint_2"}
    )
    payload = '[[payload]]\nlink = "link_2"\nmass = 58.5\ncom_m = [0.0, 0.0, 0.1]\n'
    both = sds(load(tmp_path / "c", payload + LINK, inertias=True), CAD_INERTIAS)
    assert both["joint_2"] == pytest.approx(np.hypot(0.3 * 41.5, 0.08 * 58.5))
    known = Simulation(load(tmp_path / "d", LINK, inertias=True))
    assert parametrise(known, Priors()).nuisances == ()
    robot = load(tmp_path / "e", '[[link]]\nlink = "link_2"\nsd_percent = 50.0\n', inertias=True)
    mass = robot.model.inertias[2].mass
    assert mass == pytest.approx(DENSITY * 0.2 * 0.2 * 0.72)
    assert sds(robot, CAD_INERTIAS)["joint_2"] == pytest.approx(0.5 * mass)


def test_a_hull_is_as_a_box_and_does_not_depend_on_where_it_is():
    box = np.array([*product([1.0, 2.0], [-1.0, 1.0], [0.0, 3.0]), (1.5, 0.0, 1.0)])
    solid = hull_solid(box)
    assert solid is not None
    assert solid.mass == pytest.approx(6.0)
    np.testing.assert_allclose(solid.lever, [1.5, 0.0, 1.5])
    moments = 6.0 / 12 * np.array([4 + 9, 1 + 9, 1 + 4])
    np.testing.assert_allclose(solid.inertia, np.diag(moments), atol=1e-12)
    assert hull_solid(box * [1, 1, 0]) is None


def guessed(folder, mass, **options):
    urdf = published(folder, **options)
    return guess(urdf, StatedMasses(mass), folder / "robot.toml").robot


def test_guessed_masses_add_up_and_go_with_size(tmp_path):
    robot = guessed(tmp_path, 600.0)
    links = {body.name: body for body in link_bodies(robot)}
    assert sum(body.mass for body in links.values()) == pytest.approx(600.0, rel=1e-3)
    assert all(body.guessed and body.sd_percent == 30.0 for body in links.values() if body.mass)
    volume = [float(np.prod(np.subtract(high, low))) for low, high in BOXES]
    by_size = [f"link_{k}" if k else "base_link" for k in np.argsort(volume)]
    assert [links[n].mass for n in by_size] == sorted(links[n].mass for n in by_size)
    for number, (low, high) in enumerate(BOXES):
        name = f"link_{number}" if number else "base_link"
        np.testing.assert_allclose(links[name].com_m, np.add(low, high) / 2, atol=1e-4)
    assert guessed_masses(tuple(links.values())).startswith("Masses are guessed, each with an sd")


def test_stated_masses_stand_and_the_rest_is_guessed_at_their_density(tmp_path):
    urdf = published(tmp_path, inertias=True)
    text = urdf.read_text()
    start = text.index("<inertial>", text.index('name="link_3"'))
    urdf.write_text(text[:start] + text[text.index("</inertial>", start) + len("</inertial>") :])
    robot = guess(urdf, StatedMasses(), tmp_path / "robot.toml").robot
    assert [table.link for table in robot.config.link] == ["link_3"]
    true = DENSITY * 0.54 * 0.16 * 0.16
    assert 0.6 < robot.config.link[0].mass_kg / true < 1.5
    whole = sum(DENSITY * float(np.prod(np.subtract(high, low))) for low, high in BOXES)
    robot = guess(urdf, StatedMasses(whole), tmp_path / "robot.toml").robot
    assert robot.config.link[0].mass_kg == pytest.approx(true, rel=1e-3)


def test_placeholders_are_no_masses(tmp_path):
    robot = guessed(tmp_path, 100 * 600.0, inertias=True)
    assert len(robot.config.link) == len(BOXES)


def test_bodies_without_any_shape_are_of_usual_size(tmp_path):
    urdf = published(tmp_path)
    for mesh in (urdf.parents[1] / "meshes").iterdir():
        mesh.unlink()
    robot = guess(urdf, StatedMasses(300.0), tmp_path / "robot.toml").robot
    masses = [inertia.mass for inertia in robot.model.inertias]
    assert sum(masses) == pytest.approx(300.0, rel=1e-3)
    assert masses[1] > masses[4] > masses[6] > 0.1


def test_an_identified_robot_has_its_numbers_in_the_urdf_and_keeps_how_sure_they_were(tmp_path):
    robot = load(tmp_path / "own", LINK, inertias=True)
    simulation = Simulation(robot)
    change = np.zeros_like(simulation.elastic.inertia)
    change[simulation.elastic.bodies.index("joint_2")] = 0.1 * simulation.elastic.inertia[2]
    changed = simulation.changed(simulation.elasticity, change)
    written = write_robot(tmp_path / "out" / "robot.toml", robot, _identified(changed))
    again = Robot.load(written.robot_toml)
    expected = changed.elastic.inertia[2]
    np.testing.assert_allclose(Simulation(again).elastic.inertia[2], expected, rtol=1e-6)
    (table,) = again.config.link
    assert (table.mass_kg, table.sd_percent) == (None, 30.0)


def _identified(simulation: Simulation) -> Identification:
    found = object.__new__(Identification)
    for name, value in (("simulation", simulation), ("estimates", ())):
        object.__setattr__(found, name, value)
    return found
