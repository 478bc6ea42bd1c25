"""What [[effects]] of robot.toml add, against the other engine with the same physics."""

import numpy as np
import pytest

from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.proof.arms import ARMS
from planner.proof.deviation import AttachedMass, AttachedResonator, Deviation, Spring
from planner.proof.load import load_truth
from planner.robot.robot import Robot
from planner.robot.virtual_joints import inertia_basis

LINES = np.linspace(4.0, 60.0, 40)
BALL = "inertia_kg_m2 = [3e-3, 0, 0, 3e-3, 0, 3e-3]\n"
TILT = '[[compliance]]\njoint = "base"\naxis = {}\nstiffness = 2e6\ndamping = 600.0\n'
MASS = '[[effects.payload]]\nlink = "link_4"\nmass = 30.0\ncom_m = [0.1, 0.05, -0.2]\n'
SMALL = (
    '[[effects.resonator]]\njoint = "joint_3"\nposition_m = [0.1, 0.0, 0.2]\n'
    "direction = [0.0, 0.6, 0.8]\nmass = 14.0\nfrequency_hz = 17.0\ndamping_ratio = 0.03\n"
)
SHIFT = (
    '[[effects.compliance]]\njoint = "base"\naxis = [0, 0, 1]\nstiffness = 3.0e6\n'
    "damping = 1.0e3\nslide = true\n"
)
BEND = (
    '[[effects.compliance]]\njoint = "link_2"\naxis = [0, 0, 1]\nstiffness = 4.0e6\n'
    "damping = 2.0e3\n"
)
EFFECT = '[[effects]]\neffect = "x"\nat = ""\n'
LUMP = (AttachedMass("link_4", (0.1, 0.05, -0.2), 30.0),)
POINT = (AttachedResonator("link_3", (0.1, 0, 0.2), (0, 0.6, 0.8), 14.0, 17.0, 0.03),)
AXES = ((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0))
# The other engine's lump has a gyration radius of 1 cm; the halves of a link are cut otherwise.
SAME = {
    "a mass": (EFFECT + MASS, {"added": LUMP}, 5e-4),
    "a payload": (MASS.replace("effects.", "") + BALL, {"added": LUMP}, 1e-6),
    "a resonator": (EFFECT + SMALL, {"resonators": POINT}, 5e-4),
    "a sliding base": (
        EFFECT + SHIFT, {"extra": (Spring("base", (0, 0, 1.0), 3e6, 1e3, True),)}, 1e-6
    ),
    "a tilting base": (
        "".join(TILT.format(list(axis)) for axis in AXES),
        {"extra": tuple(Spring("base", axis, 2e6, 600.0) for axis in AXES)}, 1e-6,
    ),
    "a bending link": (EFFECT + BEND, {"extra": (Spring("link_2", (0, 0, 1.0), 4e6, 2e3),)}, 0.02),
}  # fmt: skip


def test_resonators_on_several_links_couple_with_the_robot_in_any_order(tmp_path):
    links, arm = (2, 5, 3), ARMS["kr210"]
    way = (0, 0.6, 0.8)
    several = Deviation(
        resonators=tuple(
            AttachedResonator(f"link_{k}", (0.1, 0, 0.2), way, 14.0, 11.0 + k, 0.03) for k in links
        )
    )
    path, q = arm.write(tmp_path), arm.poses(1, 3)[0]
    expected = load_truth(path, several).accelerance(q, LINES)
    blocks = [SMALL.replace("joint_3", f"joint_{k}").replace("17.0", str(11.0 + k)) for k in links]
    text = path.read_text()
    for order in (blocks, blocks[::-1]):
        path.write_text(text + "\n" + "\n".join(order).replace("effects.resonator", "resonator"))
        simulation = Simulation(Robot.load(path))
        made = simulation.accelerance(q, LINES)[0]
        assert np.linalg.norm(made - expected) <= 1e-3 * np.linalg.norm(expected)
        model = simulation.elastic
        spatial = np.einsum("bk,kij->bij", model.inertia, inertia_basis())
        moved = model.body_jacobians(q)
        whole = np.einsum("nbie,bij,nbjf->nef", moved, spatial, moved)
        np.testing.assert_allclose(model.matrices(q).mass, whole, atol=1e-9)


@pytest.mark.parametrize("effect", SAME)
def test_simulation_has_the_physics_that_the_effect_states(effect, tmp_path):
    block, deviation, tolerance = SAME[effect]
    path, q = ARMS["kr210"].write(tmp_path), ARMS["kr210"].poses(1, 3)[0]
    expected = load_truth(path, Deviation(**deviation)).accelerance(q, LINES)
    plain = Simulation(Robot.load(path)).accelerance(q, LINES)[0]
    path.write_text(f"{path.read_text()}\n{block}")
    made = Simulation(Robot.load(path)).accelerance(q, LINES)[0]
    assert np.linalg.norm(made - expected) <= tolerance * np.linalg.norm(expected)
    assert np.linalg.norm(plain - expected) > 0.05 * np.linalg.norm(expected)


def test_harmonic_stiffness_goes_with_the_angle(tmp_path):
    path, arm = ARMS["kr210"].write(tmp_path), ARMS["kr210"]
    q = np.zeros((2, 6))
    q[:, 1] = -1.5, -1.0
    cosine, sine = 4e5, -3e5
    wave = f'joint = "joint_2"\norder = 2\ncosine = {cosine}\nsine = {sine}\n'
    text = path.read_text()
    path.write_text(f'{text}\n[[effects]]\neffect = "x"\nat = ""\n[[effects.harmonic]]\n{wave}')
    made = Simulation(Robot.load(path)).modes(q, 6).frequency_hz
    for row, found in zip(q, made, strict=True):
        k = arm.torsion[1] + cosine * np.cos(2 * row[1]) + sine * np.sin(2 * row[1])
        stated = f"stiffness = {arm.torsion[1]}"
        path.write_text(text.replace(stated, f"stiffness = {k}", 1))
        np.testing.assert_allclose(
            found, Simulation(Robot.load(path)).modes(row[None], 6).frequency_hz[0], rtol=1e-9
        )


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("joint_3", "elbow", "elbow"),
        ("0.0, 0.6, 0.8", "0.0, 0.0, 0.0", "direction of the resonator at joint_3 has length 0"),
    ],
)
def test_an_effect_that_cannot_be_is_refused_by_name(tmp_path, old, new, words):
    path = ARMS["kr210"].write(tmp_path)
    block = SMALL.replace("effects.resonator", "resonator").replace(old, new)
    path.write_text(f"{path.read_text()}\n{block}")
    with pytest.raises(InputError, match=words):
        Robot.load(path)
