"""Modes of a measured pose in a Rerun recording: the robot vibrating, and the MAC matrix beside.

On the timeline "measurement" a mode stands still at its largest deflection; on "vibration" it
moves, slowed down and exaggerated, as at the pose measured last.
"""

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from matplotlib import colormaps
from matplotlib.figure import Figure

from planner.campaign import mode_motion
from planner.campaign.labels import LabelledPose
from planner.campaign.model import Model
from planner.dataset.measure import MeasuredPose
from planner.modal.matrix_modes import MatrixModes
from planner.modal.modes import LARGEST as FARTHEST
from planner.modal.modes import motions
from planner.recording.points import Layout
from planner.recording.uff import Geometry
from planner.report.modal_plots import mac_figure
from planner.report.rerun.figures import More, draw, figure_view
from planner.robot.link_bodies import Skeleton, skeleton

VIBRATION = "vibration"
FRAMES, FRAME_MS = 24, 100  # of one period on the screen
LARGEST = 0.12  # of the arm's length: how far the point moves that moves most
MOST_SHOWN = 12  # modes of measured points with a view of their own
TURNS = np.exp(2j * np.pi * np.arange(FRAMES) / FRAMES)
BEFORE_US = -1000  # what stands still lies so long before the vibration
PIECES = 6  # a line is drawn in, each in the colour of its motion
THICK, THIN, BALL = 0.02, 0.004, 0.03  # radii in units of the same
MEASURED, REST, BRIGHT = (255, 255, 255), (85, 88, 92), (235, 235, 235)
GROUND = (13, 16, 17)  # behind all that is bright, whatever theme the viewer has


def mode_views(count: int, eye: rrb.EyeControls3D) -> rrb.Container:
    """A view for each mode, and the MAC matrix with them."""
    views: list[rrb.View] = [
        rrb.Spatial3DView(
            origin=f"/modes/mode_{k + 1}", name=f"mode {k + 1}", background=GROUND, eye_controls=eye
        )
        for k in range(count)
    ]
    return rrb.Grid(*views, figure_view("modes/mac", "MAC"), name="Modes")


def draw_modes(
    stream: rr.RecordingStream, model: Model, pose: LabelledPose, measured: MeasuredPose | None
) -> None:
    """The modes of a measured pose, now and moving from then on, and the MAC of their shapes."""
    robot, simulation = model.cell.robot, model.low.simulation
    seen = mode_motion.measured_shapes(robot, pose, measured)
    drawn = skeleton(robot, pose.q)
    whole = None
    if simulation is None:
        seen = mode_motion.measured_alone(seen)
    else:
        layout = Layout(sensors=seen.names)
        count = len(pose.modes)
        whole, there = mode_motion.simulated_shapes(simulation, pose.q, drawn, layout, count)
        mac = mode_motion.agreement(seen, there)
        draw(stream, "modes/mac", _mac_figure(pose, mac, len(seen.names)))
        seen = mode_motion.matched(seen, there)
    for k in range(len(pose.modes)):
        path = f"modes/mode_{k + 1}"
        _still(stream, path, drawn, _title(pose, k), robot.arm_m)
        size = LARGEST * robot.arm_m
        if whole is not None and np.all(np.isfinite(whole.motion[k])):
            rest, way = (_pieces(drawn, v) for v in (drawn.place_m, size * whole.motion[k]))
            move_lines(stream, f"{path}/simulated", rest, way, THICK * robot.arm_m)
        _points(stream, f"{path}/measured", seen, k, size, robot.arm_m)


def _still(
    stream: rr.RecordingStream, path: str, drawn: Skeleton, title: str, reach_m: float
) -> None:
    lines = [drawn.place_m[list(pair)] for pair in drawn.lines]
    stream.log(f"{path}/rest", rr.LineStrips3D(lines, radii=THIN * reach_m, colors=REST))
    below = drawn.place_m[0] - [0.0, 0.0, 0.08 * reach_m]
    stream.log(
        f"{path}/title",
        rr.Points3D([below], radii=0.0001, labels=[title], colors=BRIGHT, show_labels=True),
    )


def _points(
    stream: rr.RecordingStream, path: str, seen: mode_motion.PointShapes, k: int, size: float,
    reach_m: float,
) -> None:  # fmt: skip
    """Sensors where they move to by the measured shape."""
    known = np.all(np.isfinite(seen.motion[k]), axis=1)
    places, motion = seen.place_m[known], size * seen.motion[k][known]
    names = [f"{n} (measured)" for n, there in zip(seen.names, known, strict=True) if there]
    balls = rr.Points3D(
        places + motion.real, radii=BALL * reach_m, colors=MEASURED, labels=names,
        show_labels=len(names) > 1,
    )  # fmt: skip
    stream.log(path, balls)
    move_points(stream, path, places, motion)


def move_lines(
    stream: rr.RecordingStream, path: str, rest: np.ndarray, way: np.ndarray, radius: float
) -> None:
    """Lines (n, 2, 3) that move by `way` (n, 2, 3), complex, coloured by how far they move."""
    far = np.linalg.norm(np.abs(way.mean(axis=1)), axis=1)
    lines = rr.LineStrips3D(rest + way.real, radii=radius, colors=_colours(far))
    stream.log(path, lines)
    strips = [strip for turn in TURNS for strip in rest + np.real(way * turn)]
    columns = rr.LineStrips3D.columns(strips=strips).partition([len(rest)] * FRAMES)
    stream.send_columns(path, [_times()], columns)


def move_points(stream: rr.RecordingStream, path: str, rest: np.ndarray, way: np.ndarray) -> None:
    """Points (n, 3), drawn at the path already, that move by `way` (n, 3), complex."""
    if len(rest):
        places = np.concatenate([rest + np.real(way * turn) for turn in TURNS])
        columns = rr.Points3D.columns(positions=places).partition([len(rest)] * FRAMES)
        stream.send_columns(path, [_times()], columns)


def _colours(far: np.ndarray) -> np.ndarray:
    share = far / (np.max(far, initial=0.0) or 1.0)
    return (255 * colormaps["plasma"](0.1 + 0.85 * share)).astype(np.uint8)


def _mac_figure(pose: LabelledPose, mac: np.ndarray, points: int) -> Figure:
    """MAC (k, l) of measured (rows) and simulated shapes."""
    rows = [
        f"{k + 1}: {mode.frequency_hz:.1f} Hz" if mode else f"{k + 1}: none"
        for k, mode in enumerate(pose.modes)
    ]
    columns = [f"{j + 1}: {hz:.1f}" for j, hz in enumerate(pose.simulated_hz)]
    few = ";\ndifferent modes can look alike in so few" if points == 1 else ""
    title = f"{pose.pose}: MAC of shapes at {3 * points} coordinates{few}"
    figure = mac_figure(mac, rows, columns, title)
    figure.axes[0].set(xlabel="simulated (Hz)", ylabel="measured")
    return figure


def _title(pose: LabelledPose, k: int) -> str:
    mode, simulated = pose.modes[k], pose.simulated_hz[k]
    said = [f"{pose.pose}, mode {k + 1}:"]
    if mode is None:
        said.append("not found in the recordings")
    else:
        said.append(f"{mode.frequency_hz:.2f} Hz, damping {100 * mode.damping_ratio:.1f} %")
    if np.isfinite(simulated):
        said.append(f"(simulation {simulated:.2f} Hz)")
    return " ".join(said)


def _pieces(drawn: Skeleton, values: np.ndarray) -> np.ndarray:
    """Ends (lines · PIECES, 2, 3) of values (p, 3) at points, between them in proportion."""
    at = np.linspace(0.0, 1.0, PIECES + 1)[:, None]
    pieces = []
    for a, b in drawn.lines:
        along = values[a] + at * (values[b] - values[a])
        pieces.append(np.stack([along[:-1], along[1:]], axis=1))
    return np.concatenate(pieces)


def _times() -> rr.TimeColumn:
    return rr.TimeColumn(VIBRATION, duration=FRAME_MS * np.arange(FRAMES).astype("timedelta64[ms]"))


def moving_shapes(found: MatrixModes, geometry: Geometry) -> More:
    """Draws the first modes of measured points in motion, coloured by how far each point moves."""

    def drawn(stream: rr.RecordingStream) -> tuple[rrb.Container, rrb.TimePanel]:
        index = {node: k for k, node in enumerate(geometry.nodes)}
        ends = np.array([(index[a], index[b]) for a, b in geometry.lines], int).reshape(-1, 2)
        rest, views = geometry.position_m, []
        extent = float(np.linalg.norm(np.ptp(rest, axis=0))) or 1.0
        radius = 0.004 * extent
        stream.set_time(VIBRATION, duration=np.timedelta64(BEFORE_US, "us"))
        for k, mode in enumerate(found.modes[:MOST_SHOWN], 1):
            path, motion = f"modes/shape/{k}", motions(found.dofs, mode.shape, geometry)
            way = FARTHEST * extent * motion
            still = rr.LineStrips3D(rest[ends], colors=REST, radii=radius / 4)
            stream.log(f"{path}/rest", still, static=True)
            colours = _colours(np.linalg.norm(np.abs(way), axis=1))
            stream.log(f"{path}/points", rr.Points3D(rest, colors=colours, radii=radius))
            move_points(stream, f"{path}/points", rest, way)
            move_lines(stream, f"{path}/lines", rest[ends], way[ends], radius / 2)
            name = f"{k}: {mode.frequency_hz:.4g} Hz"
            views.append(rrb.Spatial3DView(origin=f"/{path}", name=name, background=GROUND))
        stream.reset_time()
        moves = rrb.TimePanel(
            state="collapsed", timeline=VIBRATION, play_state="playing", loop_mode="all"
        )
        return rrb.Grid(*views, name="Mode shapes"), moves

    return drawn
