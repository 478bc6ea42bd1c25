"""Checks of joint limits and speeds, and of the frames of tool and sensor."""

import numpy as np

from planner.check.remark import CheckRemark
from planner.robot.robot import Robot

WIDEST_RAD = 20.0  # of a limit: three turns; 360 rad are 57
NEVER_RAD = 20 * np.pi  # ten turns to a side
FASTEST_RAD_S = 50.0  # hands of the fastest reach 42; heavy arms' slowest joints have 60°/s
LONGEST_M, FASTEST_M_S = 100.0, 10.0  # of a rail; in mm both are a thousand times as much
PARALLEL_DEG = 1.0
APART_M = 0.6  # between where the hammer hits and where the sensor sits
EARTH_M_S2 = 9.81


def check_joints(robot: Robot, planned: bool = False) -> list[CheckRemark]:
    """What looks wrong in limits (rad, m of those that slide) and speeds (rad/s, m/s).

    With a workspace `planned` it is an error where no such joint can be: the limits keep nobody
    from driving there.
    """
    found = []
    rows = zip(
        robot.joint_names, robot.lower_rad, robot.upper_rad, robot.velocity_rad_s, strict=True
    )
    for name, low, high, speed in rows:
        where = f"{robot.urdf_path.name}, joint {name}"
        wrong = (_shifts if robot.slides(name) else _turns)(float(low), float(high), float(speed))
        away = max(abs(low), abs(high))
        never = planned and not robot.slides(name) and NEVER_RAD < away < np.inf
        severity = "error" if never else "warning"
        found += [CheckRemark(severity, text, where, remedy) for text, remedy in wrong]
        if not 0 < speed < np.inf:
            text = "It has no speed limit: what it takes to get to a pose cannot be told."
            unit = "m/s" if robot.slides(name) else "rad/s"
            found.append(CheckRemark("note", text, where, f"Add velocity in {unit} to <limit>."))
    return found + _followers(robot)


def _followers(robot: Robot) -> list[CheckRemark]:
    linkage = robot.linkage
    following = sorted(set(range(len(linkage.names))) - set(linkage.leads))
    leader = {k: robot.joint_names[int(np.flatnonzero(linkage.spread[k])[0])] for k in following}
    if not following:
        return []
    said = "; ".join(f"{linkage.names[k]} follows {leader[k]}" for k in following)
    text = f"{said}: never listed among the joints, and within their limits wherever these are."
    return [CheckRemark("note", text, f"{robot.urdf_path.name}, <mimic>")]


def _turns(low: float, high: float, speed: float) -> list[tuple[str, str]]:
    """What looks wrong, and its remedy, in limits (rad) and speed (rad/s)."""
    found = []
    if max(abs(low), abs(high)) > WIDEST_RAD:
        turns = (high - low) / 2 / np.pi
        text = f"Its limits are {low:.4g} and {high:.4g} rad, {turns:.0f} turns apart."
        found.append((text, "A URDF's limits are in rad: 360 degrees are 6.283."))
    if FASTEST_RAD_S < speed < np.inf:
        text = f"Its speed limit is {speed:.4g} rad/s, {speed / 2 / np.pi:.0f} turns a second."
        found.append((text, "A URDF's speeds are in rad/s, not in degrees a second."))
    return found


def _shifts(low: float, high: float, speed: float) -> list[tuple[str, str]]:
    """The same of a joint that slides: limits (m) and speed (m/s)."""
    found = []
    if max(abs(low), abs(high)) > LONGEST_M:
        text = f"It slides from {low:.4g} to {high:.4g} m, as if its limits were in millimetres."
        found.append((text, "Limits of a prismatic joint are in m."))
    if FASTEST_M_S < speed < np.inf:
        remedy = "Speeds of prismatic joints are in m/s, not in millimetres a second."
        found.append((f"Its speed limit is {speed:.4g} m/s.", remedy))
    return found


def check_frames(robot: Robot) -> list[CheckRemark]:
    """What looks wrong in the frames of tool and sensor, and in gravity."""
    config, found, where = robot.config, [], f"{robot.path.name}, sensor_frame"
    tcp, sensor = robot.model.frames[robot.tcp_id], robot.model.frames[robot.sensor_id]
    if tcp.parentJoint != sensor.parentJoint:
        text = (
            f'The sensor frame "{config.sensor_frame}" and the tcp frame "{config.tcp_frame}" '
            f"turn with different joints."
        )
        remedy = "Put the sensor beside the hit point unless it really sits there."
        found.append(CheckRemark("warning", text, where, remedy))
    else:
        between = tcp.placement.actInv(sensor.placement)
        angle = np.rad2deg(np.arccos(np.clip((np.trace(between.rotation) - 1) / 2, -1, 1)))
        if angle > PARALLEL_DEG:
            text = (
                f"The sensor frame is turned by {angle:.1f}° against the tcp frame; recordings "
                f"are read as if the two were parallel."
            )
            remedy = "Give both the same rpy, and turn the sensor's channels when recording."
            found.append(CheckRemark("warning", text, where, remedy))
        apart = float(np.linalg.norm(between.translation))
        if apart > APART_M:
            text = f"The sensor sits {apart:.3g} m from where the hammer hits."
            found.append(CheckRemark("warning", text, where, "Lengths are in m."))
    return found + _gravity(robot)


def _gravity(robot: Robot) -> list[CheckRemark]:
    gravity, where = np.array(robot.config.gravity), f"{robot.path.name}, gravity"
    size = float(np.linalg.norm(gravity))
    if abs(size / EARTH_M_S2 - 1) > 0.01:
        text = f"Gravity is {size:.4g} m/s²."
        return [CheckRemark("warning", text, where, "On Earth it is 9.81 m/s².")]
    down = gravity / size
    if down[2] > 0.999:
        text = "Gravity points up along the base's z axis: the robot hangs from a ceiling."
        remedy = "If it stands on the floor, give [0, 0, -9.81]."
        return [CheckRemark("warning", text, where, remedy)]
    if down[2] > -0.999:
        direction = ", ".join(f"{v:.2f}" for v in down)
        text = f"Gravity points along ({direction}) of the base: robot on a wall or a slope."
        return [CheckRemark("note", text, where, "If it stands on the floor, give [0, 0, -9.81].")]
    return []
