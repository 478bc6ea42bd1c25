"""The Rerun view of a campaign.

Timeline "measurement" counts measured poses. The recording holds nothing but what the campaign
determines (no clock), so the same campaign gives the same recording.
"""

import contextlib
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from matplotlib import colormaps
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from planner.campaign.cell import Cell
from planner.campaign.events import Proposal
from planner.campaign.labels import LabelledPose
from planner.campaign.model import Model
from planner.dataset.measure import MeasuredPose
from planner.report import frf_plots
from planner.report.modal_plots import frequency_figure
from planner.report.rerun_robot import WORLD, RobotDrawing
from planner.report.rerun_stream import open_stream

TIMELINE = "measurement"
COLOURS = {
    "proposed": (255, 140, 0),
    "measured": (220, 30, 30),
    "hit": (70, 140, 255),
    "obstacle": (140, 150, 155),
}
LINES = 300  # frequency lines of the pictures


class RerunView:
    """Logs a campaign to a file and/or a live viewer (on this machine only)."""

    def __init__(self, cell: Cell, rrd: Path | None, viewer: bool = False, simulated: bool = False):
        self._cell = cell
        identity = f"{cell.robot.name}|{cell.config}"
        self._stream = open_stream(identity, cell.robot.name, _blueprint(cell), rrd, viewer)
        self._simulated = False
        self._drawing = self._robot()
        self._obstacles()
        if simulated:
            self.label_simulated()

    def label_simulated(self) -> None:
        """Say on screen that the recordings are simulated."""
        self._simulated = True
        text = "# SIMULATED RECORDINGS\nNothing in this campaign was measured on a real robot."
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
            self._stream.log(
                "cell/obstacles",
                rr.Boxes3D(
                    centers=[b.center_m for b in blocks],
                    sizes=[b.size_m for b in blocks],
                    quaternions=[_quaternion(b.rpy_deg) for b in blocks],
                    labels=[b.name for b in blocks],
                    colors=COLOURS["obstacle"],
                ),
                static=True,
            )

    def _at(self, number: int) -> None:
        self._stream.set_time(TIMELINE, sequence=number)

    def _move(self, q: np.ndarray) -> None:
        if self._drawing is not None:
            self._drawing.move(q)

    def proposal(self, number: int, proposal: Proposal) -> None:
        """The robot at a proposed pose, and what is expected there."""
        self._at(number)
        q = np.deg2rad(proposal.joints_deg)
        self._move(q)
        self._stream.log(
            "cell/proposed",
            rr.Points3D(
                [proposal.position_m], radii=0.03, colors=COLOURS["proposed"], labels=proposal.pose
            ),
        )
        self.text(number, f"Proposed {proposal.pose}: {proposal.reason}", "INFO")

    def measurement(
        self,
        number: int,
        model: Model,
        pose: LabelledPose,
        measured: MeasuredPose | None,
        text: str,
    ) -> None:
        """A measured pose: robot, hits, FRF with band, workspace, learning."""
        self._at(number)
        self._move(pose.q)
        if measured is not None:
            self._hits(pose, measured)
        self._frf(model, pose, measured)
        self._campbell(model.labelled)
        self._measured_poses(model)
        self.workspace(number, model)
        for k, mode in enumerate(pose.modes):
            if mode is not None:
                path = f"modes/mode_{k + 1}"
                self._stream.log(f"{path}/frequency_hz", rr.Scalars(mode.frequency_hz))
                self._stream.log(f"{path}/damping_percent", rr.Scalars(100 * mode.damping_ratio))
        self.text(number, text, "INFO")

    def _hits(self, pose: LabelledPose, measured: MeasuredPose) -> None:
        rotation, position = self._cell.robot.forward(pose.q)
        axes = sorted({hit.axis for hit in measured.hits})
        vectors = [0.25 * hit_sign(a) * rotation[:, "xyz".index(a[1])] for a in axes]
        if axes:
            self._stream.log(
                "cell/hits",
                rr.Arrows3D(
                    origins=[position - v for v in vectors],
                    vectors=vectors,
                    radii=0.008,
                    labels=axes,
                    colors=COLOURS["hit"],
                ),
            )
        for axis in axes:
            hit = next(h for h in measured.hits if h.axis == axis)
            ms = 1000 * np.arange(hit.force_n.size) / hit.sampling_rate_hz
            head = slice(0, min(hit.force_n.size, 256))
            series = (
                ("force_n", hit.force_n),
                ("acceleration_m_s2", hit.acceleration_m_s2[hit.axis_index]),
            )
            for name, samples in series:
                path = f"hits/{axis}/{name}"
                self._stream.log(path, rr.BarChart(samples[head], abscissa=ms[head]))

    def _frf(self, model: Model, pose: LabelledPose, measured: MeasuredPose | None) -> None:
        low, high = self._cell.config.modes.band_hz
        lines = np.linspace(low, high, LINES)
        mean, sd = model.frf(pose.q[None], lines)
        for i, axis in enumerate("xyz"):
            decibels = 20 * np.log10(np.maximum(np.abs(mean[0, i, i]), 1e-12))
            self._stream.log(f"frf/{axis}{axis}_db", rr.BarChart(decibels, abscissa=lines))
        frf = measured.frf if measured else None
        inside = (frf.frequency_hz >= low) & (frf.frequency_hz <= high) if frf else None
        figure = frf_plots.frf_figure(
            lines,
            mean[0],
            sd[0],
            frf.frequency_hz[inside] if frf else None,
            frf.accelerance[:, :, inside] if frf else None,
            frf.coherence[:, :, inside] if frf else None,
            f"Pose {pose.pose}: FRF measured, and fused with its band",
        )
        self._picture("frf/picture", figure)

    def _campbell(self, poses: tuple[LabelledPose, ...]) -> None:
        """Measured and simulated natural frequencies, by label, over the measured poses."""
        nothing = (np.nan, np.nan)
        rows = [
            [nothing if m is None else (m.frequency_hz, m.frequency_sd_hz) for m in pose.modes]
            for pose in poses
        ]
        frequency, sd = np.moveaxis(np.array(rows), -1, 0)
        simulated = np.array([pose.simulated_hz for pose in poses])
        mark = "SIMULATED recordings · " if self._simulated else ""
        figure = frequency_figure(
            tuple(pose.pose for pose in poses),
            frequency,
            sd,
            simulated if np.any(np.isfinite(simulated)) else None,
            title=f"{mark}Natural frequencies over the measured poses",
        )
        self._picture("campbell/picture", figure)

    def _picture(self, path: str, figure: Figure) -> None:
        image = rr.EncodedImage(contents=frf_plots.png(figure), media_type="image/png")
        self._stream.log(path, image)

    def _measured_poses(self, model: Model) -> None:
        q = np.array([p.q for p in model.labelled])
        self._stream.log(
            "cell/measured",
            rr.Points3D(
                self._cell.robot.forward_batch(q)[1],
                radii=0.022,
                colors=COLOURS["measured"],
                labels=[p.pose for p in model.labelled],
            ),
        )

    def workspace(self, number: int, model: Model) -> None:
        """Candidates coloured by the sd of the natural frequencies (blue sure, yellow unsure)."""
        self._at(number)
        prediction = model.workspace_prediction
        relative = prediction.frequency_sd_hz / prediction.frequency_hz
        sd = 100 * np.sqrt(np.mean(relative**2, axis=1))
        # A fixed logarithmic scale, 0.1 % to 10 %, so that colours can be compared over time.
        shade = np.clip((np.log10(sd) + 1) / 2, 0, 1)
        # Without viridis' lowest quarter, which cannot be seen on a dark ground.
        colours = (255 * colormaps["viridis"](0.25 + 0.75 * shade)).astype(np.uint8)
        points = rr.Points3D(self._cell.candidates.position_m, radii=0.008, colors=colours)
        self._stream.log("cell/workspace", points)

    def learning(self, number: int, values: dict[str, float]) -> None:
        """Learning curves, by path."""
        self._at(number)
        for path, value in values.items():
            self._stream.log(f"learning/{path}", rr.Scalars(value))

    def text(self, number: int, text: str, level: str = "INFO") -> None:
        """A line in the log."""
        self._at(number)
        self._stream.log("log", rr.TextLog(text, level=level))

    def close(self) -> None:
        """Write everything out."""
        with contextlib.suppress(Exception):  # a viewer that was closed meanwhile
            self._stream.flush(timeout_sec=10.0)
        self._stream.disconnect()


def hit_sign(axis: str) -> float:
    """Sense of a signed axis."""
    return -1.0 if axis[0] == "-" else 1.0


def _quaternion(rpy_deg: tuple[float, float, float]) -> np.ndarray:
    """Quaternion (x, y, z, w) of roll, pitch and yaw about the world's axes."""
    return Rotation.from_euler("xyz", rpy_deg, degrees=True).as_quat()


def _eye(cell: Cell) -> rrb.EyeControls3D:
    """A look from the side and above at robot and workspace, whatever lies around them."""
    shoulder, reach = cell.robot.shoulder_m, cell.robot.reach_m
    away = np.mean(cell.candidates.position_m, axis=0) - shoulder
    side = np.array([away[1], -away[0], 0.0]) + 0.6 * np.array([away[0], away[1], 0.0])
    size = float(np.linalg.norm(side))
    side = side / size if size > 1e-6 else np.array([0.0, -1.0, 0.0])
    target = shoulder + 0.5 * away
    return rrb.EyeControls3D(
        position=target + reach * (1.3 * side + np.array([0.0, 0.0, 0.6])),
        look_target=target,
        eye_up=(0.0, 0.0, 1.0),
    )


def _blueprint(cell: Cell) -> rrb.Blueprint:
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(
                rrb.Spatial3DView(
                    origin="/",
                    contents=["/robot/**", "/cell/**"],
                    name=cell.robot.name,
                    spatial_information=rrb.SpatialInformation(target_frame=WORLD),
                    eye_controls=_eye(cell),
                ),
                rrb.Vertical(
                    rrb.Tabs(
                        rrb.Spatial2DView(origin="/frf/picture", name="FRF with band"),
                        rrb.Spatial2DView(origin="/campbell/picture", name="Campbell diagram"),
                    ),
                    rrb.TimeSeriesView(origin="/learning", name="sd of frequencies (%)"),
                    row_shares=[3, 2],
                ),
                column_shares=[3, 2],
            ),
            rrb.Horizontal(
                rrb.TextLogView(origin="/log", name="Log"),
                rrb.Tabs(
                    rrb.BarChartView(origin="/hits/+x/force_n", name="Force +x (N over ms)"),
                    rrb.TimeSeriesView(origin="/modes", name="Modes (Hz, %)"),
                    rrb.TextDocumentView(origin="/note", name="Note"),
                ),
                column_shares=[3, 2],
            ),
            row_shares=[4, 1],
        ),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )
