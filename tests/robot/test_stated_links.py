"""Inertias: stated in [[link]], guessed, narrowed, written into a URDF, cut into halves."""

import re
from itertools import product
from pathlib import Path

import msgspec
import numpy as np
import pinocchio as pin
import pytest
import tomlkit

from planner.campaign.from_urdf import StatedMasses, guess
from planner.dynamics.simulation import Simulation
from planner.effects.parameters import CAD_INERTIAS, INERTIAL, Priors, parametrise
from planner.errors import InputError
from planner.fit.result import Identification
from planner.fit.write_robot import write_robot
from planner.proof.arms import ARMS
from planner.robot.default_properties import hull_solid
from planner.robot.elastic_model import ElasticModel
from planner.robot.link_bodies import guessed_masses, link_bodies
from planner.robot.robot import Robot
from planner.robot.urdf_inertias import with_inertias
from planner.robot.virtual_joints import _halves, virtual_model
from tests.support.plain_arm import make_plain_arm
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


SPINDLE = '\n[[payload]]\nlink = "link_6"\nmass = 40.0\ncom_m = [0.02, 0.01, 0.3]\n'


def written(robot: Robot, change: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Inertias of bodies as loaded again after a change, and the bodies that have none of it."""
    urdf, payloads, unchanged = with_inertias(robot, ElasticModel(robot).bodies, change)
    robot.urdf_path.write_text(urdf)
    document = tomlkit.parse(robot.path.read_text())
    for block, payload in zip(document.get("payload", ()), payloads, strict=True):
        block.update(msgspec.to_builtins(payload))
    robot.path.write_text(tomlkit.dumps(document))
    return ElasticModel(Robot.load(robot.path)).inertia, unchanged


@pytest.mark.parametrize("name", list(ARMS))
@pytest.mark.parametrize("base", [False, True])
def test_a_change_is_written_whole(tmp_path: Path, name, base):
    path = ARMS[name].write(tmp_path)
    if base:
        text = path.read_text()
        block = '[[compliance]]\njoint = "base"\naxis = [1, 0, 0]\nstiffness = 1e7\ndamping = 1e4\n'
        path.write_text(text.replace("[[compliance]]", block + "\n[[compliance]]", 1))
    robot = Robot.load(path)
    elastic = ElasticModel(robot)
    rng = np.random.default_rng(0)
    change = 0.004 * elastic.inertia * rng.standard_normal((len(elastic.bodies), 1))
    change[:, 0] *= 1.2
    after, unchanged = written(robot, change)
    assert unchanged == ()
    np.testing.assert_allclose(after, elastic.inertia + change, rtol=1e-6, atol=1e-7)
    size = np.abs(change).max()
    assert np.abs(after - elastic.inertia).max() == pytest.approx(size, rel=1e-3)


def test_a_spindle_takes_the_change_that_the_flange_could_not(tmp_path: Path):
    path = ARMS["kr210"].write(tmp_path)
    path.write_text(path.read_text() + SPINDLE)
    robot = Robot.load(path)
    inertia = ElasticModel(robot).inertia
    change = np.zeros_like(inertia)
    change[-1] = -0.3 * inertia[-1]  # more than the flange weighs
    after, unchanged = written(robot, change)
    assert unchanged == ()
    np.testing.assert_allclose(after, inertia + change, rtol=1e-6, atol=1e-7)
    [spindle] = Robot.load(path).config.payload
    assert spindle.mass == pytest.approx(0.7 * 40.0)
    np.testing.assert_allclose(spindle.com_m, [0.02, 0.01, 0.3], rtol=1e-6)


def test_what_matter_cannot_form_is_left_as_it_was(tmp_path: Path):
    robot = Robot.load(ARMS["kr210"].write(tmp_path))
    elastic = ElasticModel(robot)
    change = np.zeros_like(elastic.inertia)
    change[1, 0] = -2 * elastic.inertia[1, 0]
    after, unchanged = written(robot, change)
    assert unchanged == (elastic.bodies[1],)
    np.testing.assert_allclose(after, elastic.inertia, rtol=1e-6, atol=1e-7)


def test_comments_of_the_urdf_stay(tmp_path: Path):
    path = ARMS["kr10"].write(tmp_path)
    urdf = path.with_name("robot.urdf")
    head = '<?xml version="1.0"?>\n<!-- measured in spring -->\n'
    urdf.write_text(head + urdf.read_text().replace("<joint", "<!-- a joint --><joint", 1))
    robot = Robot.load(path)
    elastic = ElasticModel(robot)
    text, *_ = with_inertias(robot, elastic.bodies, 0.001 * elastic.inertia)
    assert text.startswith(head)
    assert "<!-- a joint -->" in text


@pytest.mark.parametrize("times", [1, 200])
def test_a_body_of_less_than_no_inertia_is_refused_in_a_sentence(tmp_path, times):
    robot = Robot.load(make_plain_arm(tmp_path))
    change = np.zeros_like(ElasticModel(robot).inertia)
    change[-1] = -times * ElasticModel(robot).inertia[-1]
    with pytest.raises(InputError, match="moves no inertia of its own"):
        ElasticModel(robot, change)


LENGTH, WIDTH, HEIGHT, MASS = 1.2, 0.5, 0.3, 90.0


def bent(tmp_path, urdf=lambda text: text) -> Robot:
    """A robot whose link_2 bends."""
    path = ARMS["kr210"].write(tmp_path)
    robot = Robot.load(path)
    robot.urdf_path.write_text(urdf(robot.urdf_path.read_text()))
    path.write_text(
        path.read_text() + '\n[[effects]]\neffect = "x"\nat = ""\n[[effects.compliance]]\n'
        'joint = "link_2"\naxis = [0, 0, 1]\nstiffness = 4.0e6\ndamping = 2.0e3\n'
    )
    return Robot.load(path)


def halves(tmp_path, urdf=lambda text: text):
    """Inner and outer half (10,) each of link_2, and where it is cut (3,)."""
    robot = bent(tmp_path, urdf)
    model = virtual_model(robot)
    by_name = dict(zip(model.bodies, model.inertia, strict=True))
    cut = robot.model.jointPlacements[3].translation / 2
    return by_name["joint_2"], by_name["link_2, outer half"], cut


def block(text: str) -> str:
    """link_2 as a uniform block."""
    xx = MASS * (WIDTH**2 + HEIGHT**2) / 12
    yy = MASS * (LENGTH**2 + HEIGHT**2) / 12
    zz = MASS * (LENGTH**2 + WIDTH**2) / 12
    inertial = (
        f'<inertial><origin xyz="0.5 0.1 0" rpy="0 0 0"/><mass value="{MASS}"/>'
        f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    return re.sub(r'(<link name="link_2">)<inertial>.*?</inertial>', rf"\1{inertial}", text)


def test_halves_of_a_block_are_blocks(tmp_path):
    inner, outer, cut = halves(tmp_path, block)
    own = [WIDTH**2 + HEIGHT**2, LENGTH**2 / 4 + HEIGHT**2, LENGTH**2 / 4 + WIDTH**2]
    for half, centre in (
        (inner, np.array([0.5 - LENGTH / 4, 0.1, 0])),
        (outer, np.array([0.5 + LENGTH / 4, 0.1, 0]) - cut),
    ):
        assert half[0] == pytest.approx(MASS / 2)
        np.testing.assert_allclose(half[1:4] / half[0], centre, atol=1e-12)
        moved = MASS / 2 * (centre @ centre - centre**2)
        about = np.array([half[4], half[6], half[9]]) - moved
        np.testing.assert_allclose(about, MASS / 2 * np.array(own) / 12, rtol=1e-9)


def test_halves_together_are_the_link_whichever_way_it_leans(tmp_path):
    inner, outer, cut = halves(tmp_path)
    (tmp_path / "whole").mkdir()
    whole = virtual_model(Robot.load(ARMS["kr210"].write(tmp_path / "whole"))).inertia[1]
    assert inner[0] == pytest.approx(outer[0])
    np.testing.assert_allclose(inner[1:4] + outer[1:4] + outer[0] * cut, whole[1:4], rtol=1e-9)
    both = inner[4:] + outer[4:]  # about different points: Steiner
    steiner = np.outer(cut, outer[1:4])
    moved = 2 * np.trace(steiner) * np.eye(3) - steiner - steiner.T
    moved += outer[0] * (cut @ cut * np.eye(3) - np.outer(cut, cut))
    order = [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)]
    np.testing.assert_allclose(both + [moved[ij] for ij in order], whole[4:], rtol=1e-9, atol=1e-9)


def test_halves_are_written_and_read(tmp_path):
    """What one half has gained the other has lost, so that the link weighs the same."""
    robot = bent(tmp_path)
    simulation = Simulation(robot)
    bodies, change = simulation.elastic.bodies, np.zeros_like(simulation.elastic.inertia)
    outer = bodies.index("link_2, outer half")
    change[outer] = -0.2 * simulation.elastic.inertia[outer]
    change[bodies.index("joint_2")] = 0.2 * simulation.elastic.inertia[bodies.index("joint_2")]
    changed = _identified(simulation.changed(simulation.elasticity, change))
    written = write_robot(tmp_path / "out" / "robot.toml", robot, changed)
    again = Robot.load(written.robot_toml)
    lines_hz = np.linspace(*robot.config.band_hz, 200)
    found, read = (
        s.accelerance(robot.middle_rad, lines_hz) for s in (changed.simulation, Simulation(again))
    )
    uniform = simulation.accelerance(robot.middle_rad, lines_hz)
    # The fit's robot sags by the weights of its URDF, the written one by those found.
    assert np.linalg.norm(read - found) < 0.02 * np.linalg.norm(uniform - found)


def test_a_robot_whose_links_were_stated_without_an_sd_is_written_and_read(tmp_path):
    robot = bent(tmp_path)
    body = "mass_kg = 150.0\ncentre_m = [0.1, 0, 0]\ninertia_kg_m2 = [5, 0, 0, 9, 0, 9]\n"
    with robot.path.open("a") as file:
        file.write(f'\n[[link]]\nlink = "link_3"\n{body}')
    robot = Robot.load(robot.path)
    simulation = Simulation(robot)
    changed = simulation.changed(simulation.elasticity, 0.02 * simulation.elastic.inertia)
    written = write_robot(tmp_path / "out" / "robot.toml", robot, _identified(changed))
    again = Simulation(Robot.load(written.robot_toml)).elastic
    np.testing.assert_allclose(again.inertia, changed.elastic.inertia, rtol=1e-6, atol=1e-6)


def test_an_outer_half_that_leaves_nothing_is_refused(tmp_path):
    robot = bent(tmp_path)
    half = "{mass_kg = 1e4, centre_m = [0, 0, 0], inertia_kg_m2 = [1, 0, 0, 1, 0, 1]}"
    with robot.path.open("a") as file:
        file.write(f'\n[[link]]\nlink = "link_2"\nouter_half = {half}\n')
    with pytest.raises(InputError, match="outer_half"):
        Simulation(Robot.load(robot.path))


def test_a_body_whose_halves_would_have_no_moments_is_refused():
    body = pin.Inertia(1.0, np.zeros(3), np.diag([1e-3, 1e-3, 1e-3])).toDynamicParameters()
    with pytest.raises(InputError, match="moments of inertia"):
        _halves(np.array(body), np.array([0.5, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]))
