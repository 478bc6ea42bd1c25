"""The Rerun view of a campaign.

Timeline "measurement" counts measured poses; on "vibration" modes move. The recording holds
nothing but what the campaign determines (no clock), so the same campaign gives the same recording.
"""

import contextlib
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from matplotlib import colormaps
from scipy.spatial.transform import Rotation

from planner.campaign import events
from planner.campaign.cell import Cell
from planner.campaign.labels import LabelledPose
from planner.campaign.model import Model
from planner.campaign.undo import in_words
from planner.dataset.measure import MeasuredPose
from planner.report.plot_marks import AXES
from planner.report.rerun import progress
from planner.report.rerun.figures import draw, figure_view, open_stream
from planner.report.rerun.modes import BEFORE_US, GROUND, VIBRATION, draw_modes, mode_views
from planner.report.rerun.robot import WORLD, RobotDrawing

TIMELINE = "measurement"
COLOURS = {
    "proposed": (255, 140, 0),
    "measured": (220, 30, 30),
    "hit": (70, 140, 255),
    "obstacle": (140, 150, 155),
}
SCALE = "0.01 % dark to 10 % yellow"
NEAR = 0.75  # modes are seen from nearer than the cell
NOTE = """\
Timeline `measurement` counts the measured poses: drag it, or play it.
Choose the timeline `vibration` at the bottom and press play: the modes move as at the pose
measured last, slowed down and exaggerated.

- **Cell**: the robot at the pose measured last or proposed next; orange: proposed; red: measured;
  blue: hits; grey: table and fences; small dots: poses of the workspace, coloured by the sd of
  their natural frequencies ({scale}).
- **FRFs**: black as measured; orange what was predicted before it was measured, with ± 2 sd; blue
  what is believed with it.
- **Modes**: the robot as the simulation has it, yellow where it moves most; white: sensors as
  measured; thin: at rest. MAC 1: same shape, 0: none in common.
- **Progress**: what is not known yet of the workspace; frequencies expected and measured.
"""


class RerunView:
    """Logs a campaign, event by event, to a file and/or a live viewer (on this machine only)."""

    def __init__(self, cell: Cell, rrd: Path | None, viewer: bool = False, simulated: bool = False):
        self._cell = cell
        self._before: Model | None = None  # the model of the entry told last
        identity = f"{cell.robot.name}|{cell.config}"
        layout = _blueprint(cell, "progress/0")
        self._stream = open_stream(identity, cell.robot.name, layout, rrd, viewer)
        self._progress = progress.MeasuredSeries(
            self._stream, lambda path: self._stream.send_blueprint(_blueprint(cell, path))
        )
        self._drawing = self._robot()
        self._obstacles()
        self._note("")
        if simulated:
            self.label_simulated()

    def label_simulated(self) -> None:
        """Say on screen that the recordings are simulated."""
        self._note("# SIMULATED RECORDINGS\nNothing here was measured on a real robot.\n\n")

    def _note(self, head: str) -> None:
        text = f"{head}# {self._cell.robot.name}\n{NOTE.format(scale=SCALE)}"
        self._stream.log("note", rr.TextDocument(text, media_type="text/markdown"), static=True)

    def _robot(self) -> RobotDrawing | None:
        """The robot; where its URDF cannot be drawn there are still the points."""
        try:
            return RobotDrawing(self._cell.robot, self._stream)
        except Exception as error:  # the loader raises whatever a URDF makes it raise
            text = f"The robot cannot be drawn from its URDF: {error}"
            self._stream.log("log", rr.TextLog(text, level="WARN"), static=True)
            return None

    def _obstacles(self) -> None:
        blocks = self._cell.robot.config.obstacle
        if blocks:
            turns = Rotation.from_euler("xyz", [b.rpy_deg for b in blocks], degrees=True)
            centers, sizes = [b.center_m for b in blocks], [b.size_m for b in blocks]
            boxes = rr.Boxes3D(
                centers=centers, sizes=sizes, quaternions=turns.as_quat(),
                labels=[b.name for b in blocks], colors=COLOURS["obstacle"],
            )  # fmt: skip
            self._stream.log("cell/obstacles", boxes, static=True)

    def _at(self, number: int) -> None:
        self._stream.set_time(TIMELINE, sequence=number)
        # Measurements are 1 µs apart.
        self._stream.set_time(VIBRATION, duration=np.timedelta64(BEFORE_US + number, "us"))

    def _move(self, q: np.ndarray) -> None:
        if self._drawing is not None:
            self._drawing.move(q)

    def log(self, entry: events.Entry, model: Model, measured: MeasuredPose | None = None) -> None:
        """Show one event; `model` is that after it."""
        event, number = entry.event, len(model.labelled)
        self._at(number)
        match event:
            case events.Proposed():
                for proposal in event.proposals:
                    self.proposal(number, proposal)
            case events.Imported():
                self._imported(event, model, measured)
            case events.Confirmed():
                self._measured(event.pose, model, None, f"Confirmed {event.pose}")
            case events.Refused():
                for hit in event.hits:
                    self._say(f"Refused {hit.file}: {hit.reason}", "WARN")
            case events.Skipped() | events.Withdrawn():
                reason = f": {event.reason}" if event.reason else ""
                self._say(f"{type(event).__name__} {event.pose}{reason}", "WARN")
            case events.Starred():
                self._say(f"Starred {event.pose}")
            case events.Undone():
                self._say(f"{in_words(entry).capitalize()} of the log", "WARN")
            case events.FilesShown() | events.FilesPlaced():
                return
            case _:
                self._say(f"Configured {model.cell.robot.name}")
        if not isinstance(event, events.Proposed | events.Refused | events.Starred):
            target = self._cell.config.stop.frequency_sd_percent
            self._progress.log(number, progress.uncertainty(model.frequency_sd_percent, target))
        self._before = model

    def _imported(
        self, event: events.Imported, model: Model, measured: MeasuredPose | None
    ) -> None:
        found = ", ".join(f"{m.frequency_hz:.2f} Hz" for m in event.modes if m.likely)
        if any(hit.simulated for hit in event.hits):
            self.label_simulated()
        for hit in event.hits:
            if not hit.accepted:
                self._say(f"Refused {hit.file}: {hit.reason}", "WARN")
        if event.question is not None:
            self._say(f"Held back: {event.question.text}", "WARN")
        else:
            text = f"Imported {event.pose}: {found or 'no usable modes'}"
            self._measured(event.pose, model, measured, text)

    def proposal(self, number: int, proposal: events.Proposal) -> None:
        """The robot at a proposed pose, and what is expected there."""
        self._at(number)
        q = self._cell.robot.joints.internal(proposal.joints_deg)
        self._move(q)
        place, colour = [proposal.position_m], COLOURS["proposed"]
        dot = rr.Points3D(place, radii=0.03, colors=colour, labels=proposal.pose)
        self._stream.log("cell/proposed", dot)
        self._say(f"Proposed {proposal.pose}: {proposal.reason}")

    def _measured(self, name: str, model: Model, measured: MeasuredPose | None, text: str) -> None:
        """A measured pose: robot, hits, FRFs and modes against what was expected before."""
        number, before = len(model.labelled), self._before
        pose = next((p for p in model.labelled if p.pose == name), None)
        if pose is None:
            self._say(text, "WARN")
            return
        self._move(pose.q)
        if measured is not None:
            self._hits(pose, measured)
            draw(self._stream, "hits/force", progress.force_figure(measured))
        figures = progress.frf_figures(model, before, pose, measured)
        for axis, figure in zip(AXES, figures, strict=True):
            draw(self._stream, f"frf/{axis}{axis}", figure)
        self._progress.log(number, progress.measured_modes(pose, before))
        self._at(number)
        draw_modes(self._stream, model, pose, measured)
        q = np.array([p.q for p in model.labelled])
        dots = rr.Points3D(
            self._cell.robot.forward_batch(q)[1], radii=0.022, colors=COLOURS["measured"],
            labels=[p.pose for p in model.labelled],
        )  # fmt: skip
        self._stream.log("cell/measured", dots)
        self._workspace(model)
        self._say(text)

    def _hits(self, pose: LabelledPose, measured: MeasuredPose) -> None:
        rotation, position = self._cell.robot.forward(pose.q)
        axes = sorted({hit.axis for hit in measured.hits})
        size = 0.18 * self._cell.robot.arm_m  # length of an arrow
        sign = {"-": -size, "+": size}
        vectors = [sign[a[0]] * rotation[:, AXES.index(a[1])] for a in axes]
        if axes:
            style = {"radii": 0.03 * size, "labels": axes, "colors": COLOURS["hit"]}
            origins = [position - v for v in vectors]
            self._stream.log("cell/hits", rr.Arrows3D(origins=origins, vectors=vectors, **style))

    def _workspace(self, model: Model) -> None:
        """Candidates coloured by the sd of the natural frequencies (blue sure, yellow unsure)."""
        prediction = model.workspace_prediction
        relative = prediction.frequency_sd_hz / prediction.frequency_hz
        sd = 100 * np.sqrt(np.mean(relative**2, axis=1))
        # A fixed logarithmic scale, 0.01 % to 10 %, so that colours can be compared over time.
        shade = np.clip((np.log10(sd) + 2) / 3, 0, 1)
        # Without viridis' lowest quarter, which cannot be seen on a dark ground.
        colours = (255 * colormaps["viridis"](0.25 + 0.75 * shade)).astype(np.uint8)
        points = rr.Points3D(self._cell.candidates.position_m, radii=0.008, colors=colours)
        self._stream.log("cell/workspace", points)

    def _say(self, text: str, level: str = "INFO") -> None:
        """A line in the log."""
        self._stream.log("log", rr.TextLog(text, level=level))

    def close(self) -> None:
        """Write everything out."""
        with contextlib.suppress(Exception):  # a viewer that was closed meanwhile
            self._stream.flush(timeout_sec=10.0)
        self._stream.disconnect()


def _eye(cell: Cell, near: float = 1.0) -> rrb.EyeControls3D:
    """A look from the side and above at robot and workspace; `near` below 1 goes nearer."""
    shoulder, reach = cell.robot.shoulder_m, cell.robot.reach_m
    away = np.mean(cell.candidates.position_m, axis=0) - shoulder
    side = np.array([away[1], -away[0], 0.0]) + 0.6 * np.array([away[0], away[1], 0.0])
    size = float(np.linalg.norm(side))
    side = side / size if size > 1e-6 else np.array([0.0, -1.0, 0.0])
    target = shoulder + 0.5 * away
    return rrb.EyeControls3D(
        position=target + near * reach * (1.3 * side + np.array([0.0, 0.0, 0.6])),
        look_target=target,
        eye_up=(0.0, 0.0, 1.0),
    )


def _blueprint(cell: Cell, series: str) -> rrb.Blueprint:
    """All views; series of what was learned lie below the path `series`."""
    count = cell.config.modes.count
    robot = rrb.Spatial3DView(
        origin="/",
        contents=["/robot/**", "/cell/**"],
        name=f"{cell.robot.name}; dots: workspace by sd of its frequencies, {SCALE}",
        background=GROUND,
        spatial_information=rrb.SpatialInformation(target_frame=WORLD),
        eye_controls=_eye(cell),
    )
    log = rrb.TextLogView(
        origin="/log",
        name="Decisions",
        columns=rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"]),
    )
    target = cell.config.stop.frequency_sd_percent
    learned = progress.learning_view(series, target)
    beside = rrb.Vertical(figure_view("frf/xx", "FRF xx of the tool"), learned, log)
    frfs = [figure_view(f"frf/{a}{a}", f"FRF {a}{a} of the tool") for a in AXES]
    return rrb.Blueprint(
        rrb.Tabs(
            rrb.Horizontal(robot, beside, column_shares=[3, 2], name="Cell"),
            rrb.Grid(*frfs, figure_view("hits/force", "Force of the hits"), name="FRFs"),
            mode_views(count, _eye(cell, NEAR)),
            progress.progress_views(series, count, target),
            rrb.TextDocumentView(origin="/note", name="What is what"),
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="following"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )
