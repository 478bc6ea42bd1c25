"""Drift: stiffness that changes in the course of the campaign, whatever the pose.

All springs are multiplied by e^ψ(order), order being 0 at the first visit and 1 at the last. A pose
that was visited twice tells by itself; otherwise the simulation, refitted together with the
course, takes what belongs to the pose.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from planner.diagnose.effect import Effect, Quantity
from planner.diagnose.finding import Finding
from planner.diagnose.fit import Fit, Grade, Problem, fit, settle
from planner.diagnose.objective import Misfit
from planner.diagnose.visits import Recorded
from planner.identify.data import common_band
from planner.physics.gradient import Inertias, response_gradient
from planner.physics.simulation import Simulation
from planner.robot.elastic import Matrices

SD = 0.2  # of ψ at the end
BEND_SD = 3.0  # of κ in (1 − e^(−κ·order)) / (1 − e^(−κ)): 0 is linear, large is a warming up
ALIKE = 40.0  # neighbouring values that err alike where the simulation lacks something
CLEAR = 8.0
COURSE = 0.01  # relative sd of the change: no course is quite one of these
SHARE = 3.0  # by which the misfit has to fall: physics that goes with the pose gains less
MOVED = 3.0  # sds that the change has to be away from none
STILL = 2.0  # times the noise: a pose that answers alike when visited again has not drifted


@dataclass(frozen=True)
class Drift(Effect):
    """ψ(order) of one kind: "gradual" (end, bend), "step" (size, after `since`), "free" (each)."""

    kind: str = "gradual"
    since: float = 0.5

    name = "drift"

    def log_factor(self, order: np.ndarray, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """ψ(order) (n,) and its derivatives (n, p)."""
        if self.kind == "step":
            after = (order >= self.since).astype(float)
            return psi[0] * after, after[:, None]
        if self.kind == "free":
            return np.append(0.0, psi), np.vstack([np.zeros(len(psi)), np.eye(len(psi))])
        shape, slope = _bent(order, psi[1])
        return psi[0] * shape, np.stack([shape, psi[0] * slope], axis=1)

    def starts(self) -> np.ndarray:
        """See `Effect.starts`."""
        if self.kind == "gradual":
            return np.array([[0.5 * SD, 0.0], [-0.5 * SD, 0.0]])
        return np.array([[q.mean for q in self.quantities]])

    def text(self, values: dict[str, tuple[float, float, str]]) -> str:
        """See `Effect.text`."""
        size, sd, _ = values["change"]
        how = "at once" if self.kind == "step" else "bit by bit"
        return (
            f"Stiffness changes by {100 * size:.3g} ± {100 * sd:.1g} % in the course of the "
            f"campaign, {how}: let the robot warm up, and return to a pose to check."
        )


def _bent(order: np.ndarray, bend: float) -> tuple[np.ndarray, np.ndarray]:
    """(1 − e^(−κo)) / (1 − e^(−κ)) and its derivative with respect to κ."""
    if abs(bend) < 1e-4:
        return order + bend * order * (1 - order) / 2, order * (1 - order) / 2
    up, down = -np.expm1(-bend * order), -np.expm1(-bend)
    rise = order * np.exp(-bend * order)
    return up / down, rise / down - up * np.exp(-bend) / down**2


@dataclass(frozen=True, eq=False)
class DriftMisfit(Misfit):
    """As `Misfit`, each visit with springs of its own: those of x times e^ψ."""

    order: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def response(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `Misfit.response`."""
        assert isinstance(self.effect, Drift)
        p, (a, b) = self.parametrisation, self.split
        elasticity = p.elasticity(x[:a])
        psi, slope = self.effect.log_factor(self.order, x[b:])
        mass = self.matrices.mass + self.inertias.mass_change(x[a:b])
        values, slopes = [], []
        for i in range(len(self.order)):
            now = replace(elasticity, stiffness=elasticity.stiffness * np.exp(psi[i]))
            one = slice(i, i + 1)
            m = self.matrices
            matrices = Matrices(m.mass[one], m.hit[one], m.sensor[one], m.geometric[one])
            inertias = None
            if self.inertial:
                inertias = Inertias(self.inertias.jacobians[one], self.inertias.basis)
            h, full = response_gradient(matrices, now, self.setting.s[one], mass[one], inertias)
            e, springs = p.size, len(p.held)
            theta = np.einsum("np...,pq->nq...", full[:, :springs], p.spread, optimize=True)
            along = full[:, :e].sum(axis=1)
            own = slope[i][None, :, None, None, None] * along[:, None]
            values.append(h)
            slopes.append(np.concatenate([theta, full[:, springs:], own], axis=1))
        return np.concatenate(values), np.concatenate(slopes)


@dataclass(frozen=True, eq=False)
class DriftProblem(Problem):
    """A problem whose FRFs are those of visits at `order` (n,)."""

    order: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def misfit(self, effect: Effect, grade: Grade) -> Misfit:
        """See `Problem.misfit`."""
        plain = super().misfit(effect, grade)
        if not isinstance(effect, Drift):
            return plain
        fields = {name: getattr(plain, name) for name in plain.__dataclass_fields__}
        return DriftMisfit(**fields, order=self.order)


def problem_of(recorded: Recorded, nominal: Simulation) -> DriftProblem:
    """Visits, each for itself, as data of `fit`."""
    band = common_band(recorded.frfs, recorded.band_hz)
    order = np.array([visit.order for visit in recorded.visits])
    return DriftProblem(recorded.frfs, recorded.q, nominal, band, order=order)


def fits(recorded: Recorded, nominal: Simulation) -> tuple[Fit, ...]:
    """The refitted simulation without drift, and with it: gradual, and at once."""
    problem = problem_of(recorded, nominal)
    plain = fit(problem, Effect(""))
    end = Quantity("change", "1", 0.0, SD)
    gradual = Drift("campaign", (end, Quantity("bend", "1", 0.0, BEND_SD)), "gradual")
    found = [fit(problem, gradual, [plain])]
    count = len(problem.order) - 1
    each = tuple(Quantity(f"visit_{i + 2}", "1", 0.0, SD) for i in range(count))
    free = fit(problem, Drift("campaign", each, "free"), [plain])
    found.append(fit(problem, Drift("campaign", (end,), "step", _since(free, problem)), [free]))
    return plain, *found


def _since(free: Fit, problem: DriftProblem) -> float:
    """Where the visits' own ψ fall apart into two groups."""
    psi = np.append(0.0, free.x[free.misfit.split[1] :])
    ways = range(1, len(psi))
    spread = [psi[:i].var() * i + psi[i:].var() * (len(psi) - i) for i in ways]
    cut = 1 + int(np.argmin(spread))
    return float(problem.order[cut])


def screen(recorded: Recorded, nominal: Simulation) -> tuple[Finding, ...]:
    """`drift`, where the recordings change with time and not with the pose alone."""
    if len(recorded.visits) < 4 or _unchanged(recorded):
        return ()
    plain, *found = fits(recorded, nominal)
    best = settle(problem_of(recorded, nominal), min(found, key=lambda f: f.per_value))
    finding = evaluate(plain, best)
    explained = plain.per_value > SHARE * best.per_value
    # A fit that drift led out of a wrong minimum gains by that alone.
    change, sd, _ = finding.parameters["change"]
    there = explained and abs(change) > MOVED * sd
    return (finding,) if there and finding.log_evidence > CLEAR else ()


def evaluate(plain: Fit, best: Fit) -> Finding:
    """The gain of a fit with drift over the one without, and its parameters."""
    misfit = max(best.per_value, 1.0)
    temper = misfit * (1 + ALIKE * (1 - 1 / misfit))
    values = best.parameters(temper)
    size, sd, _ = values["change"]
    change = float(np.expm1(size))
    told = {"change": (change, float(np.hypot((1 + change) * sd, COURSE * change)), "1")}
    evidence = best.log_evidence(temper) - plain.log_evidence(temper)
    return Finding("drift", "campaign", evidence, told, best.effect.text(told))


def _unchanged(recorded: Recorded) -> bool:
    """Whether a pose that was returned to answers as before."""
    apart = returned(recorded)
    return apart is not None and apart < STILL


def returned(recorded: Recorded) -> float | None:
    """χ² per value between first and last visit of a pose; largest of the poses, None without."""
    found = []
    for i, visit in enumerate(recorded.visits):
        again = [j for j, v in enumerate(recorded.visits) if j > i and v.pose == visit.pose]
        if not again:
            continue
        total, count = 0.0, 0
        for a in recorded.columns[i]:
            for b in recorded.columns[again[-1]]:
                if (a.axis, a.level) == (b.axis, b.level):
                    variance = a.variance + b.variance
                    used = np.isfinite(variance)
                    square = np.abs(a.accelerance - b.accelerance)[used] ** 2
                    total += float(np.sum(square / variance[used]))
                    count += int(used.sum())
        if count:
            found.append(total / count)
    return max(found) if found else None
