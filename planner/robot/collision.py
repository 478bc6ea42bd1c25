"""Joint limits, self-collision and obstacles of a pose."""

from functools import cached_property

import coal
import numpy as np
import pinocchio as pin

from planner.errors import InputError
from planner.robot.robot import Robot, silenced

LIMIT_TOLERANCE_RAD = 1e-9
ALWAYS = 24  # poses at which a pair must touch to be taken for overlapping geometry


class Collisions:
    """Says what keeps a robot from standing at a pose.

    Checked are all pairs of links except neighbours, links that overlap at every pose (their
    geometry does, not the robot), and those that robot.toml's [collision] ignores; and every
    moving link against every [[obstacle]].
    """

    def __init__(self, robot: Robot):
        self.robot = robot

    @cached_property
    def _geometry(self) -> tuple[pin.GeometryModel, pin.GeometryData, pin.Data]:
        robot = self.robot
        geometry = _link_geometry(robot)
        links = list(range(geometry.ngeoms))
        boxes = [geometry.addGeometryObject(obj) for obj in _obstacles(robot)]
        ignored = {frozenset(pair) for pair in robot.config.collision.ignore}
        for i, j in [(i, j) for i in links for j in links if i < j]:
            a, b = geometry.geometryObjects[i], geometry.geometryObjects[j]
            names = frozenset((self._link(geometry, i), self._link(geometry, j)))
            if names not in ignored and not _neighbours(robot.model, a, b):
                geometry.addCollisionPair(pin.CollisionPair(i, j))
        for i in links:
            for box in boxes:
                names = frozenset((self._link(geometry, i), geometry.geometryObjects[box].name))
                if geometry.geometryObjects[i].parentJoint > 0 and names not in ignored:
                    geometry.addCollisionPair(pin.CollisionPair(i, box))
        self._drop_overlapping(geometry)
        data = geometry.createData()
        for request in data.collisionRequests:
            request.security_margin = robot.config.collision.margin_m
        return geometry, data, robot.model.createData()

    def _link(self, geometry: pin.GeometryModel, index: int) -> str:
        frame = geometry.geometryObjects[index].parentFrame
        return str(self.robot.model.frames[frame].name)

    def _drop_overlapping(self, geometry: pin.GeometryModel) -> None:
        """Remove pairs of links that touch at every one of a spread of poses."""
        rng = np.random.default_rng(0)
        robot, data = self.robot, geometry.createData()
        always = np.ones(len(geometry.collisionPairs), dtype=bool)
        for _ in range(ALWAYS):
            q = rng.uniform(robot.lower_rad, robot.upper_rad)
            pin.computeCollisions(robot.model, robot.model.createData(), geometry, data, q, False)
            always &= [r.isCollision() for r in data.collisionResults]
        for pair in [p for p, a in zip(list(geometry.collisionPairs), always, strict=True) if a]:
            geometry.removeCollisionPair(pair)

    def limits(self, q: np.ndarray) -> tuple[str, ...]:
        """Violated joint limits, one phrase each."""
        robot, found = self.robot, []
        for name, value, low, high in zip(
            robot.joint_names, q, robot.lower_rad, robot.upper_rad, strict=True
        ):
            if value < low - LIMIT_TOLERANCE_RAD or value > high + LIMIT_TOLERANCE_RAD:
                side, limit = ("below", low) if value < low else ("above", high)
                found.append(
                    f"{name} at {np.rad2deg(value):.1f}° is {side} its limit of "
                    f"{np.rad2deg(limit):.1f}°"
                )
        return tuple(found)

    def contacts(self, q: np.ndarray) -> tuple[str, ...]:
        """Pairs in contact, one phrase each."""
        geometry, data, kinematics = self._geometry
        if not len(geometry.collisionPairs):
            return ()
        q = np.asarray(q, dtype=float)
        pin.computeCollisions(self.robot.model, kinematics, geometry, data, q, False)
        found = []
        for pair, result in zip(geometry.collisionPairs, data.collisionResults, strict=True):
            if result.isCollision():
                second = geometry.geometryObjects[pair.second]
                other = self._link(geometry, pair.second) if second.parentJoint else second.name
                found.append(f"{self._link(geometry, pair.first)} touches {other}")
        return tuple(dict.fromkeys(found))

    def free(self, q: np.ndarray) -> bool:
        """Whether the pose is within limits and touches nothing (stops at the first contact)."""
        if self.limits(q):
            return False
        geometry, data, kinematics = self._geometry
        if not len(geometry.collisionPairs):
            return True
        q = np.asarray(q, dtype=float)
        return not pin.computeCollisions(self.robot.model, kinematics, geometry, data, q, True)

    def violations(self, q: np.ndarray) -> tuple[str, ...]:
        """All that is wrong with a pose (dof,), limits first; empty when it is free."""
        return self.limits(q) + self.contacts(q)


def _link_geometry(robot: Robot) -> pin.GeometryModel:
    folders = [str(robot.urdf_path.parent), str(robot.urdf_path.parent.parent)]
    with silenced():
        try:
            return pin.buildGeomFromUrdfString(
                robot.model, robot.urdf_text, pin.GeometryType.COLLISION, package_dirs=folders
            )
        except Exception as error:
            text = " ".join(str(error).split())
            raise InputError(
                f"{robot.urdf_path}: its collision geometry cannot be loaded ({text}); put the "
                f"meshes beside the URDF or use boxes and cylinders."
            ) from None


def _obstacles(robot: Robot) -> list[pin.GeometryObject]:
    made = []
    for block in robot.config.obstacle:
        rotation = pin.rpy.rpyToMatrix(*np.deg2rad(block.rpy_deg))
        placement = pin.SE3(rotation, np.array(block.center_m, dtype=float))
        made.append(pin.GeometryObject(block.name, 0, placement, coal.Box(*block.size_m)))
    return made


def _neighbours(model: pin.Model, a: pin.GeometryObject, b: pin.GeometryObject) -> bool:
    i, j = a.parentJoint, b.parentJoint
    return i == j or model.parents[i] == j or model.parents[j] == i
