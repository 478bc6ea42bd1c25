"""What [[effects]] and a base of robot.toml add, against another engine and by formulas."""

import numpy as np
import pinocchio as pin
import pytest

from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.proof.arms import ARMS
from planner.proof.deviation import AttachedMass, AttachedResonator, Deviation, Spring
from planner.proof.load import load_truth
from planner.robot.robot import Robot
from planner.robot.virtual_joints import inertia_basis, virtual_model

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
BEAM = (
    '[[effects.compliance]]\njoint = "link_2"\naxis = [0, 1, 0]\nlever_m = 0.3\nstiffness = 4.0e6\n'
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
    "a beam": (
        EFFECT + BEND + BEAM,
        {"extra": (Spring("link_2", (0, 0, 1.0), 4e6, 2e3),
                   Spring("link_2", (0, 1.0, 0), 4e6 / 0.09, 2e3 / 0.09, True))}, 0.02,
    ),
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


COLUMN_KG, MOMENT, HEIGHT, FOOT, STIFFNESS = 300.0, 20.0, 1.2, 0.7, 4e6
COLUMN = f"""<robot name="column">
<link name="floor"/>
<link name="column"><inertial><origin xyz="0 0 {HEIGHT}"/><mass value="{COLUMN_KG}"/>
<inertia ixx="{MOMENT}" iyy="{MOMENT}" izz="{MOMENT}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="turn" type="revolute"><parent link="floor"/><child link="column"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<link name="tool"/><joint name="flange" type="fixed"><origin xyz="0 0 1.5"/>
<parent link="column"/><child link="tool"/></joint>
</robot>"""
STIFF = "stiffness_n_m = 1e13\ndamping_n_s_m = 1.0"
ROCKING = f"stiffness = {STIFFNESS}\ndamping = 100.0\nheight_m = {-FOOT}"
BLOCKS = {
    "turn": "axis = [0, 0, 1]\nstiffness = 1e12\ndamping = 1.0",
    "about x": f"axis = [1, 0, 0]\n{ROCKING}",
    "along x": f"axis = [1, 0, 0]\n{STIFF}",
    "along y": f"axis = [0, 1, 0]\n{STIFF}",
}


def column(folder, **replaced: str) -> Robot:
    """A rigid column that rocks about x at its foot, FOOT below the origin."""
    (folder / "robot.urdf").write_text(COLUMN)
    blocks = BLOCKS | {name.replace("_", " "): text for name, text in replaced.items()}
    rows = [
        f'[[compliance]]\njoint = "{"turn" if name == "turn" else "base"}"\n{text}\n'
        for name, text in blocks.items() if text
    ]  # fmt: skip
    head = (
        'name = "column"\nurdf = "robot.urdf"\ntcp_frame = "tool"\nsensor_frame = "tool"\n'
        "gravity = [0, 0, 0]\nband_hz = [1.0, 100.0]\n"
    )
    (folder / "robot.toml").write_text(head + "".join(rows))
    return Robot.load(folder / "robot.toml")


def rocking_hz(arm_m: float) -> float:
    return float(np.sqrt(STIFFNESS / (MOMENT + COLUMN_KG * arm_m**2)) / (2 * np.pi))


@pytest.mark.parametrize("height", [-FOOT, 0.0, 0.3])
def test_what_rocks_turns_about_the_height_that_is_stated(height, tmp_path):
    robot = column(
        tmp_path, about_x=f"axis = [1, 0, 0]\n{ROCKING}".replace(str(-FOOT), str(height))
    )
    [[first, *_]] = Simulation(robot).modes(np.zeros((1, 1)), 1).frequency_hz
    assert first == pytest.approx(rocking_hz(HEIGHT - height), rel=1e-6)


def test_shifts_of_the_base_add_to_its_turning(tmp_path):
    """A force at the tool moves it by the sum of both compliances."""
    along = 5e6
    soft = f"axis = [0, 1, 0]\nstiffness_n_m = {along}\ndamping_n_s_m = 1.0"
    robot = column(tmp_path, along_y=soft)
    elastic = Simulation(robot).elastic
    hit = elastic.matrices(np.zeros((1, 1))).hit[0, 1]  # along y
    assert np.sum(hit**2 / elastic.stiffness) == pytest.approx(
        1 / along + (1.5 + FOOT) ** 2 / STIFFNESS, rel=1e-6
    )


WRONG_PLACES = {
    "no shift": ({"along_y": ""}, r"number 2 \(base\) has height_m = -0\.7.*stiffness_n_m"),
    "of a joint": ({"turn": BLOCKS["turn"] + "\nheight_m = 0.1"}, 'rotation of joint = "base"'),
    "of a shift": ({"along_x": BLOCKS["along x"] + "\nheight_m = 0.1"}, "of a rotation"),
    "a lever of a shift": ({"along_x": BLOCKS["along x"] + "\nlever_m = 0.1"}, "without slide"),
    "a lever backwards": ({"turn": BLOCKS["turn"] + "\nlever_m = -0.1"}, "lever_m is -0.1"),
}


@pytest.mark.parametrize("case", WRONG_PLACES)
def test_a_height_or_lever_that_nothing_goes_with_is_refused(case, tmp_path):
    replaced, words = WRONG_PLACES[case]
    with pytest.raises(InputError, match=words):
        Simulation(column(tmp_path, **replaced))


def test_a_link_that_turns_and_gives_half_way_bends_as_a_uniform_beam(tmp_path):
    """Its tip gives by L³/3EI, L²/2EI and L/EI under a force and a moment across."""
    path, k = ARMS["kr210"].write(tmp_path), 4e6
    length = float(Robot.load(path).model.jointPlacements[3].translation[0])  # along its x
    of = f'\n[[compliance]]\njoint = "link_2"\nstiffness = {k}\ndamping = 2e3\ntie = "beam"\n'
    lever = f"axis = [0, 1, 0]\nlever_m = {length / np.sqrt(12)}\n"
    path.write_text(f"{path.read_text()}{of}axis = [0, 0, 1]\n{of}{lever}")
    robot = Robot.load(path)
    model = virtual_model(robot)
    data, tip = model.model.createData(), model.model.getJointId("joint_3")
    pin.computeJointJacobians(model.model, data, model.offset)
    moved = pin.getJointJacobian(model.model, data, tip, pin.LOCAL_WORLD_ALIGNED) @ model.elastic
    own = moved[:, [b.joint == "link_2" for b in robot.config.compliance]]
    gives = own @ own.T / k
    shift, turn, both = np.linalg.norm(gives[:3, :3]), gives[3:, 3:], gives[:3, 3:]
    assert shift == pytest.approx(length**2 / 3 / k)
    assert np.linalg.norm(turn) == pytest.approx(1 / k)
    assert np.linalg.norm(both) == pytest.approx(length / 2 / k)
