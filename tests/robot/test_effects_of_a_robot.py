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
LUMP = '[[effects.payload]]\nlink = "link_4"\nmass = 30.0\ncom_m = [0.1, 0.05, -0.2]\n'
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
SAME = {
    # Lumps are small spheres there (1e-4 m² times their mass), points here.
    "added_mass": (LUMP, {"added": (AttachedMass("link_4", (0.1, 0.05, -0.2), 30.0),)}, 5e-4),
    "local_resonator": (
        SMALL,
        {
            "resonators": (
                AttachedResonator("link_3", (0.1, 0, 0.2), (0, 0.6, 0.8), 14.0, 17.0, 0.03),
            )
        },
        5e-4,
    ),
    "base_compliance": (SHIFT, {"extra": (Spring("base", (0, 0, 1.0), 3e6, 1e3, True),)}, 1e-6),
    # The halves of a link that bends are cut a little otherwise there.
    "link_flexibility": (BEND, {"extra": (Spring("link_2", (0, 0, 1.0), 4e6, 2e3),)}, 0.02),
}


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
    path.write_text(path.read_text() + f'\n[[effects]]\neffect = "{effect}"\nat = ""\n{block}')
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


def test_effect_of_a_joint_that_does_not_exist_is_named(tmp_path):
    path = ARMS["kr210"].write(tmp_path)
    block = SMALL.replace("joint_3", "elbow")
    path.write_text(path.read_text() + f'\n[[effects]]\neffect = "x"\nat = ""\n{block}')
    with pytest.raises(InputError, match="elbow"):
        Robot.load(path)


def test_a_resonator_without_a_direction_is_refused(tmp_path):
    path = ARMS["kr210"].write(tmp_path)
    block = SMALL.replace("effects.resonator", "resonator").replace(
        "0.0, 0.6, 0.8", "0.0, 0.0, 0.0"
    )
    path.write_text(f"{path.read_text()}\n{block}")
    with pytest.raises(InputError, match="direction of the resonator at joint_3 has length 0"):
        Robot.load(path)
