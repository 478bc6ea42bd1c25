"""Picture of a robot at a pose: links, joint axes, tool and sensor frames, masses, obstacles."""

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

from planner.report.plot_marks import empty, plain_text
from planner.robot.link_bodies import LinkBody, RobotLines, robot_lines
from planner.robot.robot import Robot

LINK, SHAPE, OBSTACLE, MASS = "0.25", "tab:blue", "tab:brown", "tab:orange"
AXIS_COLOURS = "tab:red", "tab:green", "tab:blue"  # x, y, z, as CAD programs have them
VIEWS = (("seen from the side", (0, 2)), ("seen from above", (0, 1)))
FRAME = 0.14  # length of a drawn frame, in units of the arm's length
NEAR = 0.07  # in the same units: joints so close to each other share a label
AREA_PER_SHARE = 1200.0  # of a mass's dot in points², times its share of the whole


def robot_figure(robot: Robot, q: np.ndarray, links: tuple[LinkBody, ...]) -> Figure:
    """The robot at q (dof,) in rad: from the side, from above, and in space."""
    lines = _close(robot_lines(robot, q, links), robot.shoulder_m, robot.reach_m)
    stands = robot.joints.listed(robot.joints.shown(q), 0)
    figure = empty((15.0, 6.0), f"At joint angles ({stands})")
    grid = figure.add_gridspec(1, 3)
    for column, (name, pair) in enumerate(VIEWS):
        panel = figure.add_subplot(grid[0, column])
        guessed = any(link.guessed for link in links)
        _flat(panel, lines, pair, FRAME * robot.arm_m, " (guessed)" if guessed else "")
        panel.set(title=name, xlabel=f"{'xyz'[pair[0]]} (m)", ylabel=f"{'xyz'[pair[1]]} (m)")
    _space(figure.add_subplot(grid[0, 2], projection="3d"), lines, FRAME * robot.arm_m)
    return figure


def _close(lines: RobotLines, shoulder_m: np.ndarray, reach_m: float) -> RobotLines:
    """Without what of the obstacles lies where the tool never comes."""
    low, high = shoulder_m - reach_m, shoulder_m + reach_m
    cut = (np.clip(corners, low, high) for corners in lines.obstacles)
    return replace(lines, obstacles=[c for c in cut if np.ptp(c, axis=0).all()])


def _flat(
    panel: Axes, lines: RobotLines, pair: tuple[int, int], length: float, remark: str
) -> None:
    a, b = pair
    for box, colour in ((lines.obstacles, OBSTACLE), (lines.shapes, SHAPE)):
        for corners in box:
            hull = _outline(corners[:, pair])
            panel.fill(hull[:, 0], hull[:, 1], color=colour, alpha=0.12, lw=0)
            panel.plot(*np.vstack([hull, hull[:1]]).T, color=colour, lw=0.6, alpha=0.6)
    for start, end in lines.links:
        panel.plot([start[a], end[a]], [start[b], end[b]], color=LINK, lw=3, solid_capstyle="round")
    for _, place, axis in lines.joints:
        tip = place + 0.6 * length * axis
        arrow = {"arrowstyle": "->", "color": "black", "lw": 1.4}
        panel.annotate("", (tip[a], tip[b]), (place[a], place[b]), arrowprops=arrow)
        panel.plot(place[a], place[b], "o", color="white", mec="black", ms=6)
    _names(panel, lines, pair, NEAR * length / FRAME)
    whole = sum(mass for mass, _ in lines.masses) or 1.0
    for k, (mass, place) in enumerate(lines.masses):
        label = f"centre of mass, area ~ mass{remark}" if k == 0 else None
        panel.scatter(place[a], place[b], s=AREA_PER_SHARE * mass / whole, color=MASS, alpha=0.6,
                      zorder=3, lw=0, label=label)  # fmt: skip
    for k, (name, place, rotation) in enumerate(lines.frames):
        _frame(panel, pair, place, rotation, 0.7 * length)
        panel.annotate(plain_text(name), (place[a], place[b]), xytext=(8, 22 if k else -26),
                       textcoords="offset points", fontsize=9, weight="bold")  # fmt: skip
    panel.margins(x=0.25)  # for the names on the left
    panel.set_aspect("equal", adjustable="datalim")
    panel.grid(True, alpha=0.25)
    if lines.masses:
        panel.legend(fontsize=8, loc="lower right")


def _names(panel: Axes, lines: RobotLines, pair: tuple[int, int], near: float) -> None:
    """Names of the joints, one label for those that this view shows `near` each other."""
    groups: list[tuple[np.ndarray, list[str]]] = []
    for name, place, _ in lines.joints:
        at = place[list(pair)]
        same = next((names for other, names in groups if np.hypot(*(at - other)) < near), None)
        if same is None:
            groups.append((at, [plain_text(name)]))
        else:
            same.append(plain_text(name))
    # Frames are named on the right; on the left labels in turn sit above and below.
    for k, (at, names) in enumerate(groups):
        panel.annotate(
            "\n".join(names), tuple(at), xytext=(-26, 12 if k % 2 else -12), va="center",
            textcoords="offset points", fontsize=8, ha="right",
            arrowprops={"arrowstyle": "-", "lw": 0.4, "color": "0.5"},
        )  # fmt: skip


def _frame(panel: Axes, pair: tuple[int, int], place: np.ndarray, rotation: np.ndarray, length):
    """The three axes of a frame; one that points at the viewer is a dot."""
    a, b = pair
    for k, colour in enumerate(AXIS_COLOURS):
        tip = place + length * rotation[:, k]
        panel.plot([place[a], tip[a]], [place[b], tip[b]], color=colour, lw=1.8, zorder=4)
        if np.hypot(tip[a] - place[a], tip[b] - place[b]) > 0.2 * length:
            panel.text(tip[a], tip[b], "xyz"[k], color=colour, fontsize=8, zorder=5)


def _space(panel, lines: RobotLines, length: float) -> None:
    for start, end in lines.links:
        panel.plot(*np.array([start, end]).T, color=LINK, lw=3)
    for boxes, colour in ((lines.obstacles, OBSTACLE), (lines.shapes, SHAPE)):
        for corners in boxes:
            for i, j in _edges(corners):
                panel.plot(*corners[[i, j]].T, color=colour, lw=0.5, alpha=0.6)
    for _, place, axis in lines.joints:
        panel.plot(*np.array([place, place + 0.6 * length * axis]).T, color="black", lw=1.2)
    for number, (name, place, rotation) in enumerate(lines.frames):
        for k, colour in enumerate(AXIS_COLOURS):
            panel.plot(*np.array([place, place + length * rotation[:, k]]).T, color=colour, lw=1.8)
        beside = "bottom" if number else "top"  # tool and sensor are near each other
        panel.text(*place, f"  {plain_text(name)}", fontsize=8, va=beside)
    panel.set_aspect("equal")
    panel.set(xlabel="x (m)", ylabel="y (m)", zlabel="z (m)")
    panel.tick_params(labelsize=7)


def _edges(corners: np.ndarray) -> list[tuple[int, int]]:
    """Pairs of the eight corners of a box, counted in binary, that an edge joins."""
    return [(i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit]


def _outline(points: np.ndarray) -> np.ndarray:
    """Convex hull of points (n, 2), in order; those of a box seen edge on may be on a line."""
    return points[ConvexHull(points, qhull_options="QJ").vertices]
