"""Sensitivity of frequencies and FRFs to the simulation's parameters, and Fisher information.

The parameters are those that `identify` fits: logarithms of springs and dampers, inertias in sds
of their prior. Where another sensor, or hits at another point too, tell most of them per minute is
I-optimal in the linearised model (Chaloner & Verdinelli 1995), as `parameter_variance` is.
"""

from dataclasses import dataclass

import numpy as np

from planner.design.acquisitions import parameter_reduction
from planner.design.cost import Cost
from planner.design.frequency_posterior import ALL_AXES, AXES, FrequencyOutputs, Poses
from planner.dynamics.motion import Motion
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import SimulatedModes
from planner.fit.frequency_uncertainty import log_frequency_slope
from planner.fit.misfit import FrfMisfit
from planner.fit.posterior import RobotBelief
from planner.frf.frf import Frf
from planner.measurement.agreement import MODEL_ERROR
from planner.measurement.measured_frfs import ASSUMED_FLOOR, ASSUMED_RELATIVE, noise_sd
from planner.measurement.nuisances import NuisanceCounts, basis, real_rows
from planner.recording.points import SENSOR, TCP, TOOL, Layout

# Lines around each mode at which the information is summed up, in half-widths of its resonance.
AROUND = np.array([-6.0, -3.0, -1.5, -0.75, 0.0, 0.75, 1.5, 3.0, 6.0])
EVEN_LINES = 9  # lines spread evenly over the band besides
POSES_PER_CHUNK = 8  # which bounds the memory taken


@dataclass(frozen=True)
class FrfNoise:
    """Sd of an FRF: a share of it and a floor (m/s²/N; None: a share of its rms), a line `step_hz`.

    `misfit` is χ² per value of what was identified; above 1 the information is less by that factor.
    `sensors` are the points that listen.
    """

    relative: float
    floor: float | None
    step_hz: float
    misfit: float = 1.0
    sensors: tuple[str, ...] = TOOL.sensors

    @classmethod
    def of(cls, frfs: tuple[Frf, ...], band_hz: tuple[float, float], misfit: float) -> "FrfNoise":
        """As in the FRFs measured so far, and the last one's sensors; assumed without any."""
        floors, steps = [], []
        sensors = frfs[-1].layout.sensors if frfs else TOOL.sensors
        for frf in frfs:
            inside = (frf.frequency_hz >= band_hz[0]) & (frf.frequency_hz <= band_hz[1])
            sd = noise_sd(frf)[..., inside]
            known = np.isfinite(sd) & (sd > 0)
            if known.any() and np.sum(inside) > 1:
                floors.append(float(np.median(sd[known])))
                steps.append(float(frf.frequency_hz[1] - frf.frequency_hz[0]))
        if not floors:
            step, floor, share = (band_hz[1] - band_hz[0]) / 200, None, ASSUMED_RELATIVE
        else:
            step, floor = float(np.median(steps)), float(np.median(floors))
            share = MODEL_ERROR
        return cls(share, floor, step, max(misfit, 1.0), sensors)


@dataclass(frozen=True, eq=False)
class UncertainParameters:
    """What is believed of a robot, and how FRFs to come would be measured."""

    belief: RobotBelief
    noise: FrfNoise
    band_hz: tuple[float, float]

    @property
    def simulation(self) -> Simulation:
        """Of the robot as it is believed to be."""
        return self.belief.simulation

    @property
    def covariance(self) -> np.ndarray:
        """(p, p) of the physical numbers."""
        return self.belief.covariance[self.belief.physical, self.belief.physical]

    def poses(
        self,
        x: np.ndarray,
        low: np.ndarray,
        q: np.ndarray,
        simulated: SimulatedModes,
        informed: bool,
    ) -> Poses:
        """Poses q (n, dof) in rad with their slopes and, where `informed`, their information.

        `simulated` are the simulation's modes there.
        """
        slope = np.zeros((0, low.shape[1], len(self.covariance)))
        if len(q):
            slope = log_frequency_slope(self.belief, q, simulated)
        information = self.information(q) if informed else np.zeros((len(q), AXES, 0, 0))
        return Poses(x, low, np.nan_to_num(slope), information)

    def information(self, q: np.ndarray, layout: Layout | None = None) -> np.ndarray:
        """Fisher information (n, 3, p, p) of one hit along each axis at q (n, dof) in rad.

        Of the one point that `layout` hits, while its sensors listen; without it the tcp is hit and
        the sensors of the FRFs so far listen.
        """
        layout = layout or Layout((TCP,), self.noise.sensors)
        starts, p = range(0, len(q), POSES_PER_CHUNK), len(self.covariance)
        parts = (self._information(q[i : i + POSES_PER_CHUNK], layout) for i in starts)
        return np.concatenate([np.zeros((0, AXES, p, p)), *parts])

    def _information(self, q: np.ndarray, layout: Layout) -> np.ndarray:
        frequency, count = self._lines(q)
        belief = self.belief
        misfit = FrfMisfit(belief.structure, belief.at(q, frequency, layout), belief.tolerances)
        motion = misfit.motion(belief.x, None)
        h, (told, visits) = motion.accelerance, misfit.slopes(motion, belief.x)
        # What no hit along an axis moves is never measured along it: it tells nothing.
        sd = self._sd(h)
        sd = np.where(sd > 0, sd, np.inf)
        weight = np.sqrt(2 * count[:, None, None] / self.noise.misfit) / sd
        both, rows = (told, self._of_the_visit(motion, misfit, visits)), self._channels(layout)
        told, beside = ((one * weight[:, None])[:, :, rows] for one in both)
        return np.array([
            [_marginal_information(a[:, :, axis], b[:, :, axis]) for axis in range(AXES)]
            for a, b in zip(told, beside, strict=True)
        ])  # fmt: skip

    def _of_the_visit(self, motion: Motion, misfit: FrfMisfit, visits: np.ndarray) -> np.ndarray:
        """Columns (n, l, r, c, F), in sds, of what a visit has of its own, as the fit takes it.

        Hits beside their axis and point, joints beside their readback, springs as they are that
        day. Joints and springs are common to hits along all axes, each of which is told apart here:
        each has a third of what they tell.
        """
        t, s = self.belief.tolerances, misfit.data.measured.s
        numbers = NuisanceCounts.of(motion.accelerance)
        every = basis(motion.accelerance, motion, s, t)
        common = np.concatenate([every[:, numbers.known :], visits], axis=1)
        return np.concatenate([every[:, : numbers.hits], np.sqrt(AXES) * common], axis=1)

    def _channels(self, layout: Layout) -> list[int]:
        """Rows of FRFs that the sensors have axes for."""
        named = self.simulation.robot.points
        return [
            3 * place + "xyz".index(axis)
            for place, name in enumerate(layout.sensors)
            for axis in named.axes_of(name)
        ]

    def _sd(self, h: np.ndarray) -> np.ndarray:
        """Root of E|δH|² of one hit's FRF h (n, 3 s, 3, F)."""
        floor = self.noise.floor
        if floor is None:
            floor = ASSUMED_FLOOR * np.sqrt(np.mean(np.abs(h) ** 2, axis=(1, 3), keepdims=True))
        return np.hypot(self.noise.relative * np.abs(h), floor)

    def _lines(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lines (n, F) in Hz, close where the resonances are, and how many real ones each is."""
        low, high = self.band_hz
        modes = self.simulation.modes(q, self.simulation.elastic.size)
        f, zeta = modes.frequency_hz[..., None], modes.damping_ratio[..., None]
        near = (f * (1 + np.minimum(zeta, 0.1) * AROUND)).reshape(len(q), -1)
        near = np.where((near > low) & (near < high), near, low)
        even = np.broadcast_to(np.linspace(low, high, EVEN_LINES), (len(q), EVEN_LINES))
        lines = np.sort(np.concatenate([near, even], axis=1), axis=1)
        edges = np.concatenate(
            [lines[:, :1], (lines[:, 1:] + lines[:, :-1]) / 2, lines[:, -1:]], axis=1
        )
        return lines, np.diff(edges, axis=1) / self.noise.step_hz


def _marginal_information(told: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """(p, p) of columns (p, …) in sds of the noise, others (l, …) integrated out, N(0, 1) each.

    a (I + bᵀ b)⁻¹ aᵀ by its root, which stays positive where nothing damps a resonance.
    """
    a, b = real_rows(told), real_rows(beside)
    size, turned = np.linalg.eigh(b @ b.T)
    size = np.maximum(size, TINY)
    b = turned.T @ b
    rest = a - (a @ b.T) * (-np.expm1(-0.5 * np.log1p(size)) / size) @ b
    return rest @ rest.T


TINY = 1e-12  # share of the variance that is always left


@dataclass(frozen=True)
class BetterPlaces:
    """A point to hit at a pose besides the tool, and the `sensors` that should listen, by name.

    "" is no such point, and `added` the sensor that is put there first, "" if none is. `sd_percent`
    is what open parameters are expected to leave of the workspace's frequencies (root mean square)
    then, `sd_percent_as_it_is` with hits at the tool alone and the sensors there are; `minutes`
    what either takes.
    """

    pose: str
    hit_point: str
    sensors: tuple[str, ...]
    added: str
    minutes: float
    minutes_as_it_is: float
    sd_percent: float
    sd_percent_as_it_is: float
    sd_percent_now: float

    @property
    def sentence(self) -> str:
        """For the engineer."""
        what = [f"put a sensor at {self.added} too"] if self.added else []
        what += [f"hit at {self.hit_point} too"] if self.hit_point else []
        return (
            f"At {self.pose} {' and '.join(what)}, if you can: the frequencies' sd should fall "
            f"from {self.sd_percent_now:.2g} to {self.sd_percent:.2g} % in {self.minutes:.1f} min. "
            f"Without that: to {self.sd_percent_as_it_is:.2g} % in {self.minutes_as_it_is:.1f} min."
        )


def better_places(
    open_: UncertainParameters,
    outputs: FrequencyOutputs,
    pose: tuple[str, Poses, np.ndarray],
    cost: Cost,
    travel: float,
    target_percent: float,
) -> BetterPlaces | None:
    """One sensor more, or hits at another point too, that gain most per minute.

    The gain is that of the logarithm of what is left: so it adds up from pose to pose. A sensor
    stays, yet its minutes are all charged here. None where hits at the tool with the sensors there
    were gain as much, or reach the target.

    Args:
        open_: the simulation's parameters, and the sensors that listened last.
        outputs: posterior of the frequencies over the workspace.
        pose: its name, itself (n = 1) and its joint angles (dof,) in rad.
        cost: minutes of a hit, and of putting up a sensor.
        travel: minutes to get there.
        target_percent: the campaign's, of the frequencies' RMSE.
    """
    name, at, q = pose
    named, there = open_.simulation.robot.points, open_.noise.sensors
    free = ["", *sorted({named.sensor(one) for one in named.axes} - {*there, SENSOR})]
    points = ["", *sorted({named.hit(one) for one in named.axes} - {TCP})]
    workspace = outputs.workspace
    open_now = outputs.parameter_variance(workspace.poses)
    now = float(np.sum(workspace.importance * open_now))

    def left(point: str, added: str) -> tuple[float, float]:
        """Variance that is left, and the minutes that it takes."""
        sensors = (*there, added) if added else there
        hits = (TCP, point) if point else (TCP,)
        told = sum(open_.information(q[None], Layout((hit,), sensors)) for hit in hits)
        seen = Poses(at.x, at.low, at.slope, np.asarray(told))
        gain = float(parameter_reduction(outputs, seen, workspace)[0])
        minutes = travel + cost.per_pose + len(hits) * cost.hitting(ALL_AXES)
        return max(now - gain, TINY * now), minutes + (cost.per_sensor if added else 0.0)

    plain = "", ""
    each = {plain: left(*plain)}
    if 100 * np.sqrt(each[plain][0]) <= target_percent:
        return None
    others = [(point, added) for point in points for added in free if point or added]
    each |= {place: left(*place) for place in others}
    rate = {key: np.log(now / rest) / minutes for key, (rest, minutes) in each.items()}
    best = max(rate, key=rate.__getitem__)
    if best == plain:
        return None
    percent = {key: 100 * float(np.sqrt(rest)) for key, (rest, _) in each.items()}
    return BetterPlaces(
        name,
        best[0],
        (*there, best[1]) if best[1] else there,
        best[1],
        each[best][1],
        each[plain][1],
        percent[best],
        percent[plain],
        100 * float(np.sqrt(now)),
    )
