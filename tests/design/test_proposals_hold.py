"""10,000 proposals on four robots, checked by MuJoCo: limits, collisions, place; and none missed.

`pytest -m slow -s tests/design/test_proposals_hold.py` prints the counts.
"""

import msgspec
import numpy as np
import pytest

from planner.campaign.cell import Cell
from planner.campaign.config import CampaignConfig
from planner.proof.arms import IRB6640, KR10, KR210
from planner.proof.inverse import joint_angles, tool_rotation
from planner.proof.load import load_truth
from planner.robot.collision import Collisions
from planner.robot.inverse_kinematics import solve
from tests.support.robots import JOINTS_DEG, make_arm

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1500)]
PROPOSALS, TARGETS, POINTS = 2500, 250, 60
DOWN = [0.0, 0.0, -1.0]
ROBOTS = {
    "KR10": (KR10.write, {"joints_deg": [list(r) for r in KR10.joints_deg]}),
    "IRB 6640": (
        IRB6640.write,
        {"position_m": [[1.0, 1.7], [-0.7, 0.7], [0.7, 1.3]], "tool_axis": DOWN,
         "rotation_deg": [-40, 40]},
    ),
    "KR210": (KR210.write, {"joints_deg": [list(r) for r in KR210.joints_deg]}),
    "small arm": (
        make_arm,
        {"position_m": [[0.45, 0.8], [-0.3, 0.3], [0.3, 0.6]], "tool_axis": DOWN,
         "rotation_deg": [-40, 40]},
    ),
}  # fmt: skip


class Independent:
    """Limits, contacts and tool position as MuJoCo reads them from the same URDF."""

    def __init__(self, cell: Cell):
        import mujoco

        self._mj, robot = mujoco, cell.robot
        text = robot.urdf_path.read_text()
        compiler = '<mujoco><compiler fusestatic="false" discardvisual="true"/></mujoco>'
        text = text.replace("</robot>", compiler + "</robot>")
        spec = mujoco.MjSpec.from_string(text)
        for box in robot.config.obstacle:
            spec.worldbody.add_geom(
                name=f"obstacle {box.name}", type=mujoco.mjtGeom.mjGEOM_BOX,
                pos=list(box.center_m), size=[s / 2 for s in box.size_m],
            )  # fmt: skip
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.tcp = self.model.body(robot.config.tcp_frame).id
        rng = np.random.default_rng(0)
        low, high = self.model.jnt_range.T
        self.overlapping: set = set()
        poses = [self.contacts(rng.uniform(low, high)) for _ in range(40)]
        self.overlapping = {p for p in set.intersection(*poses) if "obstacle" not in str(p)}

    def contacts(self, q: np.ndarray) -> set:
        """Pairs of bodies that touch, but for neighbours and what always does."""
        mj, model, data = self._mj, self.model, self.data
        data.qpos[:] = q
        mj.mj_kinematics(model, data)
        mj.mj_comPos(model, data)
        mj.mj_collision(model, data)
        found = set()
        for contact in data.contact[: data.ncon]:
            a, b = (model.geom(g) for g in (contact.geom1, contact.geom2))
            bodies = [self._joined(int(g.bodyid[0])) for g in (a, b)]
            names = frozenset(
                g.name if "obstacle" in g.name else str(i)
                for g, i in zip((a, b), bodies, strict=True)
            )
            related = bodies[0] == bodies[1] or any(
                self._joined(int(model.body_parentid[i])) == j for i, j in (bodies, bodies[::-1])
            )
            fixed = "obstacle" in str(names) and 0 in bodies and len(set(bodies)) == 1
            if fixed or (related and "obstacle" not in str(names)) or contact.dist > 0:
                continue
            found.add(names)
        return found - self.overlapping

    def _joined(self, body: int) -> int:
        """The body that moves it: links on fixed joints belong to the one that carries them."""
        while body and not self.model.body_jntnum[body]:
            body = int(self.model.body_parentid[body])
        return body

    def within(self, q: np.ndarray) -> bool:
        low, high = self.model.jnt_range.T
        return bool(np.all((q >= low - 1e-9) & (q <= high + 1e-9)))

    def position(self) -> np.ndarray:
        return self.data.xpos[self.tcp].copy()


def cell_of(name, directory):
    write, workspace = ROBOTS[name]
    toml = write(directory / "robot")
    table = {"robot": str(toml), "workspace": workspace, "acquisition": {"candidates": PROPOSALS}}
    return Cell.load(toml, msgspec.convert(table, CampaignConfig))


@pytest.mark.parametrize("name", ROBOTS)
def test_no_proposal_violates_anything_and_few_are_missed(name, tmp_path):
    cell = cell_of(name, tmp_path)
    judge, candidates = Independent(cell), cell.candidates
    broken = [i for i, q in enumerate(candidates.q) if not judge.within(q)]
    touching, off = [], []
    for i, q in enumerate(candidates.q):
        if judge.contacts(q):
            touching.append(i)
        off.append(np.linalg.norm(judge.position() - candidates.position_m[i]))
    # Targets that MuJoCo says can be reached: any pose within limits that touches nothing.
    rng, found, asked = np.random.default_rng(7), 0, 0
    collisions = Collisions(cell.robot)
    low, high = np.deg2rad(np.array(JOINTS_DEG)).T if name == "small arm" else (
        cell.robot.lower_rad, cell.robot.upper_rad
    )  # fmt: skip
    while asked < TARGETS:
        q = rng.uniform(low, high)
        if judge.contacts(q):
            continue
        rotation, position = cell.robot.forward(q)
        asked += 1
        found += solve(cell.robot, rotation, position, None, collisions, seed=asked).q is not None
    if cell.workspace.tool_axis is not None:
        accepted = len(candidates.q) / (len(candidates.q) + sum(candidates.rejected.values()))
        share = reachable_share(cell, judge)
        assert accepted >= 0.95 * share - 0.05  # of POINTS points the share is known to ± 0.05
    wide = [rng.uniform(cell.robot.lower_rad, cell.robot.upper_rad) for _ in range(100)]
    struck = [bool(judge.contacts(q)) for q in wide]
    ours = [not collisions.free(q) for q in wide]
    assert 10 < sum(struck) <= sum(ours)  # the judge is not blind
    assert len(candidates.q) == PROPOSALS
    assert not broken
    assert not touching
    assert max(off) < 1e-9
    assert found >= 0.95 * asked


def reachable_share(cell: Cell, judge: Independent) -> float:
    """Share of the workspace that MuJoCo's kinematics reach without contact, from many starts."""
    truth = load_truth(cell.robot.path)
    rng, reached = np.random.default_rng(11), 0
    space = cell.workspace
    for _ in range(POINTS):
        x, y, z, angle = rng.uniform(space.lower, space.upper)
        rotation = tool_rotation(space.tool_axis, angle)
        for _ in range(12):
            start = rng.uniform(truth.lower_rad, truth.upper_rad)
            q = joint_angles(truth, rotation, np.array([x, y, z]), start)
            if q is not None and not judge.contacts(q):
                reached += 1
                break
    return reached / POINTS
