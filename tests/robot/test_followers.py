"""Joints that follow others (<mimic>): where they go, what they weigh, and what they may not do.

Laws are checked over drawn trees of joints against differences of places, and against the same
tree whose followers are joints like all others.
"""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from planner.check.description import check_joints
from planner.errors import InputError
from planner.robot.collision import Collisions
from planner.robot.elastic_model import ElasticModel
from planner.robot.inverse_kinematics import solve
from planner.robot.link_bodies import placements
from planner.robot.robot import Robot
from tests.support.outside import said, told
from tests.support.robots import campaign_text, make_arm

LEADS, FOLLOWERS = 3, 4
STEP = 1e-4


def _numbers(values) -> str:
    return " ".join(f"{v:.9g}" for v in values)


def drawn_tree(folder, seed, springs=1e12):
    """robot.toml of a tree of links: some joints turn, some slide, the later ones follow."""
    rng, names = np.random.default_rng(seed), [f"j{k}" for k in range(LEADS + FOLLOWERS)]
    links, joints, toml, masses = ['<link name="base"/>'], [], [], []
    for k, name in enumerate(names):
        mass, com, moments = rng.uniform(1, 5), rng.normal(size=3) / 5, rng.uniform(0.2, 0.3, 3)
        axis, place, slides = rng.normal(size=3), rng.normal(size=3) / 3, rng.random() < 0.3
        axis /= np.linalg.norm(axis)
        masses.append((mass, com, moments))
        box = f'<origin xyz="{_numbers(com)}"/><geometry><box size="0.2 0.2 0.2"/></geometry>'
        links.append(
            f'<link name="l{k}"><inertial><origin xyz="{_numbers(com)}"/><mass value="{mass:.9g}"/>'
            f'<inertia ixx="{moments[0]:.9g}" iyy="{moments[1]:.9g}" izz="{moments[2]:.9g}" '
            f'ixy="0" ixz="0" iyz="0"/></inertial><collision>{box}</collision></link>'
        )
        mimic, parent = "", f"l{rng.integers(k)}" if k else "base"
        if k >= LEADS:  # of any joint before it, followers too
            factor = rng.uniform(0.3, 1.5) * rng.choice([-1, 1])
            mimic = f'<mimic joint="j{rng.integers(k)}" multiplier="{factor:.9g}" offset="0.1"/>'
        else:
            unit = "_n_m" if slides else ""
            damped = "damping_n_s_m" if slides else "damping"
            toml.append(f'[[compliance]]\njoint = "{name}"\naxis = {axis.tolist()}')
            toml.append(f"stiffness{unit} = {springs}\n{damped} = 1.0")
        joints.append(
            f'<joint name="{name}" type="{"prismatic" if slides else "revolute"}">'
            f'<parent link="{parent}"/><child link="l{k}"/>'
            f'<origin xyz="{_numbers(place)}" rpy="{_numbers(3 * place)}"/>'
            f'<axis xyz="{_numbers(axis)}"/>{mimic}'
            f'<limit lower="-1.5" upper="1.2" velocity="1" effort="0"/></joint>'
        )
    folder.mkdir(parents=True, exist_ok=True)
    text = f'<robot name="tree">{"".join(rng.permutation([*links, *joints]))}</robot>'
    (folder / "tree.urdf").write_text(text)
    head = 'name = "tree"\nurdf = "tree.urdf"\ntcp_frame = "l6"\nsensor_frame = "l6"\n'
    (folder / "robot.toml").write_text(head + "\n".join(toml) + "\n")
    return folder / "robot.toml", masses


def both(folder, seed):
    """The tree, its masses, and the same tree without <mimic>."""
    toml, masses = drawn_tree(folder / "follows", seed)
    plain, _ = drawn_tree(folder / "plain", seed)
    urdf = plain.with_name("tree.urdf")
    urdf.write_text(re.sub(r"<mimic[^>]*/>", "", urdf.read_text()))
    return Robot.load(toml), masses, Robot.load(plain)


def drawn_pose(robot, seed):
    return np.random.default_rng(seed).uniform(robot.lower_rad, robot.upper_rad)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("trees")


TREES = given(st.integers(0, 10**6))
FEW = settings(max_examples=25, deadline=None)


@FEW
@TREES
def test_followers_stand_where_the_urdf_says(folder, seed):
    robot, _, plain = both(folder, seed)
    assert sorted(robot.joint_names) == ["j0", "j1", "j2"]
    q = drawn_pose(robot, seed)
    place = dict(zip(robot.joint_names, q, strict=True))
    text = robot.urdf_path.read_text()
    for k in range(LEADS, LEADS + FOLLOWERS):
        part = re.search(rf'<joint name="j{k}".*?</joint>', text)[0]
        leader, factor = re.search(r'joint="(\w+)" multiplier="(\S+)"', part).groups()
        place[f"j{k}"] = float(factor) * place[leader] + 0.1
        assert -1.5 - 1e-9 < place[f"j{k}"] < 1.2 + 1e-9
    x = np.array([place[name] for name in plain.joint_names])
    for one, other in zip(robot.forward(q), plain.forward(x), strict=True):
        assert one == pytest.approx(other, abs=1e-9)
    found = [Collisions(one) for one in (robot, plain)]  # whose middles differ
    unchecked = {pair for collisions in found for pair in collisions.overlapping}
    touching = [set(c.contacts(at)) - unchecked for c, at in zip(found, (q, x), strict=True)]
    assert touching[0] == touching[1]
    for joint, step in enumerate(STEP * np.eye(len(q))):
        ahead, back = robot.forward(q + step), robot.forward(q - step)
        moved = robot.forward(q)[0].T @ (ahead[1] - back[1]) / (2 * STEP)
        assert robot.jacobian(q)[:3, joint] == pytest.approx(moved, abs=1e-6)


def energies(robot, q, masses):
    """Mass matrix (dof, dof) by differences of places, and second differences of the weight's."""
    ids = [robot.frame_id("link", f"l{k}") for k in range(len(masses))]
    mass = np.zeros((len(q), len(q)))
    steps = STEP * np.eye(len(q))
    ahead = [placements(robot, q + step, ids) for step in steps]
    back = [placements(robot, q - step, ids) for step in steps]
    for k, (m, com, moments) in enumerate(masses):
        speed = [(a[0][k] - b[0][k]) @ com + a[1][k] - b[1][k]
                 for a, b in zip(ahead, back, strict=True)]  # fmt: skip
        spin = [Rotation.from_matrix(b[0][k].T @ a[0][k]).as_rotvec()
                for a, b in zip(ahead, back, strict=True)]  # fmt: skip
        mass += m * np.dot(speed, np.transpose(speed)) + (spin * moments) @ np.transpose(spin)
    e = 1e-3 * np.eye(len(q))

    def f(at):
        return weight(robot, at, masses)

    return mass / (2 * STEP) ** 2, np.array(
        [[(f(q + a + b) - f(q + a - b) - f(q - a + b) + f(q - a - b)) / 4e-6 for a in e] for b in e]
    )


def weight(robot, q, masses):
    """Potential energy of all masses at q (dof,)."""
    ids = [robot.frame_id("link", f"l{k}") for k in range(len(masses))]
    stands = zip(masses, *placements(robot, q, ids), strict=True)
    return sum(9.81 * m * (turn[2] @ com + place[2]) for (m, com, _), turn, place in stands)


@FEW
@TREES
def test_mass_and_gravity_are_those_of_all_that_moves(folder, seed):
    """Springs about the joints' own axes move what the joints move, followers too."""
    robot, masses, _ = both(folder, seed)
    q = drawn_pose(robot, seed)
    told = ElasticModel(robot).matrices(q)
    order = [robot.joint_names.index(block.joint) for block in robot.config.compliance]
    mass, gravity = (found[np.ix_(order, order)] for found in energies(robot, q, masses))
    assert told.mass[0] == pytest.approx(mass, abs=1e-5 * np.abs(mass).max())
    assert told.geometric[0] == pytest.approx(gravity, abs=1e-3 + 2e-5 * np.abs(gravity).max())
    ends = robot.jacobian(q)[:3, order]
    assert told.hit[0] == pytest.approx(ends, abs=1e-7)  # but for sag


@FEW
@TREES
def test_slopes_by_angles_and_sag_know_of_followers(folder, seed):
    robot, _, _ = both(folder, seed)
    q, model = drawn_pose(robot, seed)[None], ElasticModel(robot)
    told = model.matrices(q, slopes=True).by_angle
    inertia = model.body_jacobians(q)
    assert inertia.shape[1] == LEADS + FOLLOWERS
    for joint, step in enumerate(1e-5 * np.eye(LEADS)):
        ahead, back = model.matrices(q + step), model.matrices(q - step)
        for name in ("mass", "hit"):
            slope = (getattr(ahead, name) - getattr(back, name)) / 2e-5
            assert getattr(told, name)[:, joint] == pytest.approx(slope, abs=1e-5)
    # Under its weight a soft robot is where gravity's torque on all that moves is the springs'.
    toml, masses = drawn_tree(folder / "soft", seed, springs=1e5)
    soft = Robot.load(toml)
    order = [soft.joint_names.index(block.joint) for block in soft.config.compliance]
    steps = STEP * np.eye(LEADS)[order]
    ahead, back = ([weight(soft, q[0] + s, masses) for s in way] for way in (steps, -steps))
    force = np.subtract(ahead, back) / (2 * STEP)
    assert ElasticModel(soft).sag(q)[0] == pytest.approx(-force / 1e5, abs=1e-9)


BALANCER = (  # as makers draw them: cylinder and piston that a joint's angle turns, no limits
    '<link name="cylinder"><inertial><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01" '
    'ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="cylinder_joint" type="{kind}">'
    '<parent link="link_1"/><child link="cylinder"/><origin xyz="-0.2 0 0"/><axis xyz="0 1 0"/>'
    '<mimic joint="{leader}" {numbers}/>{more}</joint>'
)
LIMIT = '<limit lower="{}" upper="{}" velocity="1" effort="0"/>'


def balanced(folder, leader="joint_a2", numbers='multiplier="-0.25"', kind="continuous", more="",
             toml="", instead=("", "")):  # fmt: skip
    path = make_arm(folder)
    urdf = folder / "arm.urdf"
    text = BALANCER.format(leader=leader, numbers=numbers, kind=kind, more=more)
    urdf.write_text(urdf.read_text().replace("</robot>", text + "</robot>").replace(*instead))
    path.write_text(f"{path.read_text()}{toml}\n")
    return path


@pytest.mark.parametrize(
    ("kind", "numbers", "limit", "range_deg"),
    [("continuous", 'multiplier="-0.25"', "", (-190, 45)),
     ("revolute", 'multiplier="-0.25"', (-0.2, 0.5), (-114.59, 45)),
     ("revolute", 'multiplier="2" offset="1"', (-2, 1.5), (-85.94, 14.32)),
     ("revolute", "", (0, 0), (-190, 45)),  # left out, as a maker's 0 to 0 is
     ("prismatic", 'multiplier="0.1" offset="-0.1"', (-0.3, 0), (-114.59, 45))],
)  # fmt: skip
def test_a_leader_stays_where_its_follower_can_go(kind, numbers, limit, range_deg, tmp_path):
    more = LIMIT.format(*limit) if limit else ""
    robot = Robot.load(balanced(tmp_path, numbers=numbers, kind=kind, more=more))
    assert robot.joint_names == Robot.load(make_arm(tmp_path / "plain")).joint_names
    found = np.rad2deg([robot.lower_rad[1], robot.upper_rad[1]])
    assert found == pytest.approx(range_deg, abs=0.01)
    said = [remark.what for remark in check_joints(robot) if "<mimic>" in remark.where]
    assert said[0].startswith("cylinder_joint follows joint_a2")


@pytest.mark.parametrize(
    ("leader", "held", "turned_deg"),
    [("joint_a2", "joint_a2_deg = -60", 15), ("tool_fixed", "", 0), ("joint_a2", "", 15),
     ("joint_a2", "cylinder_joint_deg = 40\njoint_a2_deg = -60", 40)],
)  # fmt: skip
def test_what_follows_a_joint_that_stays_stays(leader, held, turned_deg, tmp_path):
    toml = f"[held]\n{held}"
    path = balanced(tmp_path, leader, toml=toml)
    if "joint_a2" in held:  # a joint that is held has no spring
        text = path.read_text()
        block = re.search(r'\[\[compliance\]\]\njoint = "joint_a2"[^\[]*\[[^\[]*', text)[0]
        path.write_text(text.replace(block, ""))
    robot = Robot.load(path)
    names = robot.joint_names
    assert len(names) == 6 - ("joint_a2" in held)
    q = np.array([np.deg2rad(-60) if name == "joint_a2" else 0.3 for name in names])
    ids = [robot.frame_id("link", name) for name in ("link_1", "cylinder")]
    first, second = placements(robot, q, ids)[0]
    turned = Rotation.from_matrix(first.T @ second).as_rotvec(degrees=True)
    assert turned == pytest.approx([0, turned_deg, 0], abs=1e-6)


@pytest.mark.parametrize(
    ("changes", "words"),
    [({"leader": "joint_9"}, 'follows "joint_9" .* no joint'),
     ({"leader": "cylinder_joint"}, "follows itself"),
     ({"numbers": 'multiplier="a lot"'}, "no number"), ({"numbers": 'offset="1e999"'}, "no number"),
     ({"kind": "revolute", "more": LIMIT.format(3, 4)}, "nowhere are both within their limits"),
     ({"kind": "revolute", "more": LIMIT.format(-1, 0.1), "toml": "[held]\njoint_a2_deg = -60"},
      "follows joint_a2 .* beyond its limits"),
     ({"toml": "[[compliance]]\njoint = \"cylinder_joint\"\naxis = [0, 1, 0]\nstiffness = 1e5\n"
       "damping = 1.0"}, "follows another .* name one of joint_a1")],
)  # fmt: skip
def test_what_cannot_be_followed_is_said(changes, words, tmp_path):
    with pytest.raises(InputError, match=words):
        Robot.load(balanced(tmp_path, **changes))


@pytest.mark.parametrize("factor", [-1, 0.5])
def test_a_follower_in_the_wrist_is_solved_for(factor, tmp_path):
    """A hollow wrist: between joint 5 and joint 6 one more turns with joint 5."""
    wrist = (
        '<link name="link_5b"/><joint name="joint_a5b" type="continuous"><parent link="link_5"/>'
        '<child link="link_5b"/><origin xyz="0.02 0 0" rpy="0.6 0 0"/><axis xyz="0 1 0"/>'
        f'<mimic joint="joint_a5" multiplier="{factor}"/></joint>'
    )
    path = balanced(tmp_path, instead=('<parent link="link_5"/>', '<parent link="link_5b"/>'))
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(urdf.read_text().replace("</robot>", wrist + "</robot>"))
    robot = Robot.load(path)
    assert robot.tool_joints == tuple(range(6))
    round_again = robot.linkage.comes_round(robot.tool_chain)  # the balancer is beside the chain
    assert round_again.tolist() == [True] * 4 + [factor == -1, True]
    rng = np.random.default_rng(1)
    for _ in range(5):
        rotation, place = robot.forward(rng.uniform(robot.lower_rad, robot.upper_rad))
        found = solve(robot, rotation, place)
        assert found.q is not None
        assert robot.forward(found.q)[1] == pytest.approx(place, abs=1e-5)
        assert not Collisions(robot).limits(found.q)


def test_followers_are_no_columns_from_check_to_a_proposal(tmp_path):
    robot = balanced(tmp_path / "robot")
    plan = tmp_path / "campaign.toml"
    plan.write_text(campaign_text(3).replace("candidates = 200", "candidates = 40"))
    said("check", robot, "--campaign", plan)
    said("new", tmp_path / "stated", "--robot", robot, "--campaign", plan)
    own = "--urdf", robot.with_name("arm.urdf"), "--mass-kg", 55, "--campaign", plan
    said("new", tmp_path / "cell", *own)
    assert len(told("next", tmp_path / "cell")["proposals"][0]["joints_deg"]) == 6
