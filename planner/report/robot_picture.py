"""Picture of a robot at a pose: links, joint axes, tool and sensor frames, masses, obstacles."""

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

from planner.report.plot_marks import empty, plain_text, spread
from planner.robot.link_bodies import LinkBody, RobotLines, robot_lines
from planner.robot.robot import Robot

LINK, SHAPE, OBSTACLE, MASS = "0.25", "tab:blue", "tab:brown", "tab:orange"
AXIS_COLOURS = "tab:red", "tab:green", "tab:blue"  # x, y, z, as CAD programs have them
VIEWS = (("seen from the side", (0, 2)), ("seen from above", (0, 1)))
FRAME = 0.14  # length of a drawn frame, in units of the arm's length
ROOM = 0.25  # around the robot, in the same units: more of obstacles is not drawn


def robot_figure(robot: Robot, q: np.ndarray, links: tuple[LinkBody, ...]) -> Figure:
    """The robot at q (dof,) in rad: from the side, from above, and in space."""
    lines = robot_lines(robot, q, links)
    corners = _extent(lines) + ROOM * robot.arm_m * np.array([[-1.0], [1.0]])
    middle, half = corners.mean(axis=0), np.ptp(corners, axis=0).max() / 2
    cube = middle + half * np.array([[-1.0], [1.0]])  # all views have its scale
    cut = (np.clip(box, *cube) for box in lines.obstacles)
    lines = replace(lines, obstacles=[box for box in cut if np.ptp(box, axis=0).all()])
    stands = robot.joints.listed(robot.joints.shown(q), 0)
    figure = empty((15.0, 6.0), f"At joint angles ({stands})")
    grid = figure.add_gridspec(1, 3)
    for column, (name, pair) in enumerate(VIEWS):
        panel = figure.add_subplot(grid[0, column])
        guessed = any(link.guessed for link in links)
        panel.set(title=name, xlabel=f"{'xyz'[pair[0]]} (m)", ylabel=f"{'xyz'[pair[1]]} (m)")
        panel.set(xlim=cube[:, pair[0]], ylim=cube[:, pair[1]], aspect="equal")
        _flat(panel, lines, pair, FRAME * robot.arm_m, " (guessed)" if guessed else "")
    space = figure.add_subplot(grid[0, 2], projection="3d")
    _space(space, lines, FRAME * robot.arm_m)
    space.set(xlim=cube[:, 0], ylim=cube[:, 1], zlim=cube[:, 2])
    return figure


def _extent(lines: RobotLines) -> np.ndarray:
    """Least and largest coordinates (2, 3) of links, frames and shapes."""
    ends = [np.array(end)[None] for link in lines.links for end in link]
    points = np.vstack([*ends, *(place[None] for _, place, _ in lines.frames), *lines.shapes])
    return np.array([points.min(axis=0), points.max(axis=0)])


def _flat(
    panel: Axes, lines: RobotLines, pair: tuple[int, int], length: float, remark: str
) -> None:
    a, b = pair
    both = (lines.obstacles, OBSTACLE, "obstacle"), (lines.shapes, SHAPE, "collision shape")
    for boxes, colour, label in both:
        for k, corners in enumerate(boxes):
            flat = corners[:, pair]  # of a box seen edge on may be on a line
            hull = flat[ConvexHull(flat, qhull_options="QJ").vertices]
            panel.fill(hull[:, 0], hull[:, 1], color=colour, alpha=0.12, lw=0,
                       label="" if k else label)  # fmt: skip
            panel.plot(*np.vstack([hull, hull[:1]]).T, color=colour, lw=0.6, alpha=0.6)
    for start, end in lines.links:
        panel.plot([start[a], end[a]], [start[b], end[b]], color=LINK, lw=3, solid_capstyle="round")
    for _, place, axis in lines.joints:
        tip = place + 0.6 * length * axis
        arrow = {"arrowstyle": "->", "color": "black", "lw": 1.4}
        panel.annotate("", (tip[a], tip[b]), (place[a], place[b]), arrowprops=arrow)
        panel.plot(place[a], place[b], "o", color="white", mec="black", ms=6)
    _names(panel, lines, pair)
    whole = sum(mass for mass, _ in lines.masses) or 1.0
    for k, (mass, place) in enumerate(lines.masses):
        label = f"centre of mass, area ~ mass{remark}" if k == 0 else None
        panel.scatter(place[a], place[b], s=1200 * mass / whole, color=MASS, alpha=0.6,
                      zorder=3, lw=0, label=label)  # fmt: skip
    for k, (name, place, rotation) in enumerate(lines.frames):
        _frame(panel, pair, place, rotation, 0.7 * length)
        panel.annotate(plain_text(name), (place[a], place[b]), xytext=(8, 22 if k else -26),
                       textcoords="offset points", fontsize=9, weight="bold")  # fmt: skip
    panel.grid(True, alpha=0.25)
    panel.legend(fontsize=8, loc="lower right", markerscale=0.6)


def _names(panel: Axes, lines: RobotLines, pair: tuple[int, int]) -> None:
    """Names of the joints on the left, kept apart; frames are named on the right."""
    named = sorted((tuple(place[list(pair)])[::-1], name) for name, place, _ in lines.joints)
    low, high = panel.get_ylim()
    gap = 0.045 * (high - low)  # height of a label
    heights = spread(np.array([at[0] for at, _ in named]), gap, low + gap, high - gap)
    for (at, name), height in zip(named, heights, strict=True):
        panel.annotate(
            plain_text(name), at[::-1], xytext=(0.02, height), va="center", fontsize=8,
            textcoords=panel.get_yaxis_transform(),
            arrowprops={"arrowstyle": "-", "lw": 0.4, "color": "0.5", "relpos": (1.0, 0.5)},
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
            # Two of its eight corners, counted in binary, that an edge joins.
            for i, j in ((i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit):
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
