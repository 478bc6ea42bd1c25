"""What hits of one more pose are to be expected, after a fit: their density, by evidence.

The posterior of the fit is the prior of one more pose, and is refitted with it: far from what was
measured before, FRFs bend with the springs in a way that no first order follows.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.fit.data import FrfData
from planner.fit.gauss_newton import minimised
from planner.fit.misfit import FrfMisfit
from planner.fit.posterior import RobotPosterior
from planner.fit.structure import RobotStructure
from planner.frf.frf import Frf
from planner.inference.covariance import inverse
from planner.measurement.nuisances import OF_HAMMER, OF_SENSOR, Tolerances

LINES, STEPS = 44, 5
SIZES = (0.2, 0.06, 0.015, 0.004)  # of the pose's own discrepancy, if it is what it is said to be
SPREAD = 1.0  # of its logarithm about that of the poses before
STRANGE = 0.6  # where it is something else: little is left of what is expected


@dataclass(frozen=True, eq=False)
class _Informed(RobotStructure):
    """A structure of which `x` is expected, with the inverse covariance `known`."""

    x: np.ndarray = None  # pyrefly: ignore[bad-assignment]
    known: np.ndarray = None  # pyrefly: ignore[bad-assignment]

    @cached_property
    def mean(self) -> np.ndarray:
        return self.x

    @cached_property
    def precision(self) -> np.ndarray:
        return self.known


@dataclass(frozen=True, eq=False)
class ExpectedFrfs:
    """Of one more pose, after what `posterior` knows; FRFs in `band_hz` count.

    Its hits may be so many `times` farther off and more slanted than is stated, its joints so many
    `joint_times` farther beside their readback; what the last joint carries may be another than
    before, by so many `tool_sds` of what is known of a body beforehand.
    """

    posterior: RobotPosterior
    band_hz: tuple[float, float]
    times: float = 1.0
    joint_times: float = 1.0
    tool_sds: float = 0.0

    @cached_property
    def tolerances(self) -> Tolerances:
        """Of the pose."""
        t, by = self.posterior.tolerances, self.times
        joints = self.joint_times * np.array(t.joint_rad)
        joint_rad = tuple(joints.tolist()) if joints.ndim else float(joints)
        return replace(t, angle_rad=by * t.angle_rad, offset_m=by * t.offset_m, joint_rad=joint_rad)

    @cached_property
    def _structures(self) -> dict[tuple[str, ...], _Informed]:
        return {}

    def _structure(self, sensors: tuple[str, ...]) -> _Informed:
        """As these sensors hear it; of one that is new, what is known of any."""
        if sensors in self._structures:
            return self._structures[sensors]
        p, s = self.posterior, self.posterior.structure
        known = p.found.misfit.data.measured.layout.sensors
        rows = [*range(s.chain.start)]
        for name in sensors:
            first = s.chain.start + OF_SENSOR * known.index(name) if name in known else None
            rows += [-1] * OF_SENSOR if first is None else range(first, first + OF_SENSOR)
        rows += range(s.chain.stop - OF_HAMMER, s.chain.stop)
        at = np.array(rows)
        both = (at[:, None] >= 0) & (at >= 0)
        covariance = np.where(both, p.covariance[np.ix_(at, at)], np.eye(len(at)))
        tool = s.inertial.start + s.bodies.mine[s.bodies.bodies.index(self._last_joint)]
        covariance[tool, tool] += self.tool_sds**2
        x = np.where(at >= 0, p.x[at], 0.0)
        made = _Informed(s.prior, s.effects, len(sensors), x, inverse(covariance))
        self._structures[sensors] = made
        return made

    @property
    def _last_joint(self) -> str:
        """Whose body carries the tool."""
        robot = self.posterior.structure.prior.effect_library.simulation.robot
        return str(robot.model.names[robot.model.frames[robot.tcp_id].parentJoint])

    def _misfit(self, q: np.ndarray, frf: Frf, size: float) -> FrfMisfit:
        prior = self.posterior.structure.prior
        return self._of(FrfData.of(prior, (frf,), q[None], self.band_hz, LINES), size)

    def _of(self, data: FrfData, size: float) -> FrfMisfit:
        structure = self._structure(data.measured.layout.sensors)
        return FrfMisfit(structure, data, self.tolerances, size)

    def outlier_log_density(self, q: np.ndarray, frf: Frf) -> float:
        """Log density of an FRF measured at q (dof,) in rad if it is hardly what is expected."""
        misfit = self._misfit(q, frf, STRANGE)
        at, m = misfit(misfit.structure.mean), misfit.data.measured
        # Where far less was measured, as by a wrong unit of forces, it differs by what is expected;
        # after one pose that is not known well enough.
        expected, shown = (
            np.linalg.norm(h[m.used]) for h in (at.motion.accelerance, m.accelerance)
        )
        poses = len(self.posterior.found.misfit.data.q)
        if poses > 1 and 0.0 < shown < STRANGE * expected:
            misfit = misfit.with_rho(float(STRANGE**2 * expected / shown))
            at = misfit(misfit.structure.mean)
        return misfit.evidence(at)

    def density(self, q: np.ndarray, frf: Frf) -> tuple[float, float]:
        """The same if it is, but for a discrepancy like that of the poses before; its size."""
        return self._density(self._misfit(q, frf, SIZES[0]))

    def discrepancy(self, data: FrfData) -> float:
        """Share of FRFs that is not as expected, hits and chain apart, where `data` are of."""
        return self._density(self._of(data, SIZES[0]))[1]

    def _density(self, misfit: FrfMisfit) -> tuple[float, float]:
        usual, each = np.log(max(self.posterior.size, SIZES[-1])), []
        x, own = misfit.structure.mean, None
        for size in SIZES:
            misfit = misfit.with_rho(size)
            at = minimised(misfit, x, STEPS, own=own)
            x, own = at.x, at.own
            each.append(misfit.evidence(at))
        weight = -0.5 * ((np.log(SIZES) - usual) / SPREAD) ** 2
        weight -= np.logaddexp.reduce(weight)
        value = float(np.logaddexp.reduce(np.array(each) + weight))
        return value, SIZES[int(np.argmax(each))]

    def off(self, q: np.ndarray, frf: Frf) -> float:
        """By what share of the FRFs these differ from the expected ones."""
        h, measured = self._both(q, frf)
        return float(np.linalg.norm(measured - h) / np.linalg.norm(h))

    def off_by_line(self, q: np.ndarray, frf: Frf) -> float:
        """Root mean square of the same, line by line: each counts as much as another."""
        h, measured = self._both(q, frf)
        size = np.linalg.norm(h, axis=(1, 2))
        each = np.linalg.norm(measured - h, axis=(1, 2)) / np.where(size > 0, size, 1.0)
        return float(np.sqrt(np.mean(each**2)))

    def shown(self, q: np.ndarray, frf: Frf) -> np.ndarray:
        """(3s, 3s) real: what the sensors show, as a matrix of what is expected of them.

        By least squares over hits and lines, each line as much as another.
        """
        h, measured = self._both(q, frf)
        felt = (measured != 0).all(axis=1, keepdims=True)  # hits that all sensors felt
        size = np.linalg.norm(h, axis=(1, 2), keepdims=True)
        pair = (np.where(felt, one / size, 0.0)[0] for one in (h, measured))
        expected, seen = (one.reshape(len(one), -1).view(float) for one in pair)
        return np.linalg.lstsq(expected.T, seen.T)[0].T

    def _both(self, q: np.ndarray, frf: Frf) -> tuple[np.ndarray, np.ndarray]:
        """(1, r, c, F) as expected, and as measured; 0 where nothing was."""
        misfit = self._misfit(q, frf, STRANGE)
        m, h = misfit.data.measured, misfit.motion(misfit.structure.mean, None).accelerance
        return np.where(m.used, h, 0.0), np.where(m.used, m.accelerance, 0.0)
