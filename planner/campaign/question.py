"""Whether hits are of the pose, and by the chain, that they are said to be of.

What was found of the hits before tells which FRFs are to be expected anywhere, and how unsure that
is. Where "something else" is likelier than the pose as stated, what that may be competes by
evidence: another known pose, the setpoint, an angle with the other sign, axes of the sensor
exchanged, a channel with a wrong scale, a sensor that turned, hits the other way or listed along
wrong axes, one joint elsewhere, and a wrong angle of an earlier pose, which bent what is expected.
Without a simulation, or before the first measurement, nothing is expected.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize_scalar

from planner.campaign.chain_faults import NONE, ChainFault, possible
from planner.campaign.chain_question import chain_question
from planner.campaign.events import Question
from planner.campaign.model import Model
from planner.campaign.state import CampaignState
from planner.dataset.measure import MeasuredPose
from planner.effects.table import Repertoire
from planner.fit.expected import LINES, SIZES, ExpectedFrfs, turned
from planner.fit.posterior import RobotPosterior
from planner.fit.search import Search
from planner.fit.structure import RobotPrior
from planner.frf.frf import Frf
from planner.inference.parallel import side_by_side
from planner.recording.joints import JointUnits
from planner.recording.points import TOOL

LOG_ODDS = np.log(1000.0)  # against a mistake, before anything is measured
BETTER = 3.0  # times less is left by a mistake that explains them
# Measured poses before which another structure may explain what nothing known fits: until then
# the simulation alone tells of the chain, as before the first; no joint is looked for elsewhere.
SURE = 2
# A joint is looked for elsewhere by 2^NEAREST to 2^(FARTHEST − 1) times as far as readbacks err.
NEAREST, FARTHEST = 1, 7
# Measured poses among which one may be wrong unnoticed; of more it stands out
MOST_BEFORE = 3
FOLLOWED = 3  # mistakes that are fitted, those that seem likeliest at once


@dataclass(frozen=True, eq=False)
class Mistake:
    """Where the robot may be, q (dof,) in rad, and what the chain may show, instead; in words.

    A `rival` is likelier beforehand than others: it need not leave less than what is stated. One
    chosen among many that can be told apart is `rarer` by so many nats.
    """

    q: np.ndarray
    what: str
    pose: str = ""
    about: str = ""
    fault: ChainFault = NONE
    rival: bool = False
    rarer: float = 0.0


def question(
    model: Model,
    state: CampaignState,
    pose: str,
    joints_deg: tuple[float, ...],
    measured: MeasuredPose,
) -> Question | None:
    """What to ask the engineer before new hits of a pose are believed; None: nothing.

    `measured` is of the new hits alone; `model` and `state` are those before the import.
    """
    learned, frf = model.low.learned or model.low.suspect, measured.one_hit_frf
    if frf is None or learned is None:
        return None
    expected = ExpectedFrfs(learned.posterior, model.cell.config.modes.band_hz)
    joints = model.cell.robot.joints
    q = joints.internal([joints_deg])[0]
    stated, typed = StatedHits(expected, q, frf), _setpoint(model, state, pose, joints_deg)
    if not stated.doubted and not stated.instead(typed):
        return None
    mistakes = [*typed, *_poses(model, state, pose, joints_deg)]
    sure = learned.poses >= SURE
    mistakes += _chains(state, expected, q, frf, sure)
    if sure:
        mistakes += opposite(joints, joints_deg)
        mistakes += elsewhere(joints, expected, frf, joints_deg)
    fits = stated.instead(mistakes)
    if fits is None or (fits.about != "chain" and StatedHits(expected, fits.q, frf).doubted):
        fits = _earlier(model, state, pose, joints_deg, frf) or fits
    if fits is None and not stated.impossible:
        return None
    if fits is None and not sure:
        called_right = _called_right(state)
        return None if called_right else chain_question(model, pose, joints_deg, measured.frf)
    return _asked(pose, 100 * expected.off(q, frf), fits)


@dataclass(frozen=True, eq=False)
class StatedHits:
    """Hits as they are said to be: of q (dof,) in rad, by a chain as it should be."""

    expected: ExpectedFrfs
    q: np.ndarray
    frf: Frf

    @cached_property
    def strange(self) -> float:
        """Log density of something else."""
        return self.expected.strange(self.q, self.frf)

    @cached_property
    def density(self) -> tuple[float, float]:
        """Log density as stated, and the size of the discrepancy that it takes."""
        return self.expected.density(self.q, self.frf)

    @property
    def impossible(self) -> bool:
        """Whether it is something else, whatever that is."""
        return self.strange - self.density[0] > LOG_ODDS

    @property
    def doubted(self) -> bool:
        """Whether a mistake may explain it better."""
        return self.impossible or self.density[1] >= BETTER * SIZES[-1]

    def instead(self, mistakes: Sequence[Mistake]) -> Mistake | None:
        """The mistake that explains the hits, by evidence and size; None where none does."""
        columns = int(np.count_nonzero(self.frf.measured))
        value, size = self.density

        def shown(one: Mistake) -> tuple[Frf, float]:
            frf, volume = turned(self.frf, one.fault.matrix, one.fault.struck, one.fault.order)
            return frf, volume * columns * LINES

        def glanced(one: Mistake) -> float:
            frf, volume = shown(one)
            return self.expected.strange(one.q, frf) + volume - one.rarer

        found = []
        for one in sorted(mistakes, key=glanced, reverse=True)[:FOLLOWED]:
            frf, volume = shown(one)
            its, left = self.expected.density(one.q, frf)
            gain = its + volume - one.rarer - value
            better = (1 if one.rival else BETTER) * left <= size
            if gain > LOG_ODDS and (better or its + volume > self.strange > value):
                found.append((gain, one))
        return max(found, key=lambda pair: pair[0], default=(0.0, None))[1]


def _poses(
    model: Model, state: CampaignState, pose: str, joints_deg: tuple[float, ...]
) -> Iterator[Mistake]:
    """Where else the robot may be."""
    joints = model.cell.robot.joints
    known = {m.pose: m.joints_deg for m in state.used}
    known |= {name: state.proposals[name].joints_deg for name in state.open}
    known.pop(pose, None)
    for name, there in known.items():
        what = f"repeat those of {name}" if state.hit_at(name) else f"fit {name} far better"
        yield Mistake(joints.internal([there])[0], what, name)


def _setpoint(
    model: Model, state: CampaignState, pose: str, joints_deg: tuple[float, ...]
) -> list[Mistake]:
    """Where the robot was sent, where that is not what is stated."""
    joints = model.cell.robot.joints
    sent = state.proposals[pose].joints_deg if pose in state.proposals else joints_deg
    typed = np.flatnonzero(np.abs(np.subtract(sent, joints_deg)) > joints.same()).tolist()
    which = ", ".join(_either(joints, i, sent[i], joints_deg[i]) for i in typed)
    what = f"fit the setpoint of {pose} better than its readback: is {which}?"
    there = joints.internal([sent])[0]
    return [Mistake(there, what, about="readback", rival=True)] if typed else []


def elsewhere(
    joints: JointUnits, expected: ExpectedFrfs, frf: Frf, joints_deg: tuple[float, ...]
) -> Iterator[Mistake]:
    """One joint where it explains the hits best, near its angle.

    `joints_deg` (dof,) as stated: degrees, of slides mm. Each joint's place is found by a search
    along it alone, of the density of hits that are hardly what is expected.
    """
    stated, same = np.array(joints_deg), joints.same()
    steps = 2.0 ** np.arange(NEAREST, FARTHEST)
    rarer = float(np.log(2 * steps[-1] * len(stated)))

    def less(by: float, axis: np.ndarray) -> float:
        return -expected.strange(joints.internal([stated + by * axis])[0], frf)

    for i, axis in enumerate(np.diag(same)):
        tried = np.concatenate([-steps[::-1], [0.0], steps])
        each = [less(float(by), axis) for by in tried]
        best = int(np.argmin(each))
        if tried[best] == 0.0:
            continue
        around = tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)]
        by = minimize_scalar(less, bounds=around, args=(axis,), method="bounded").x
        if abs(by) < steps[0]:
            continue
        there = stated + by * axis
        what = f"fit another angle far better: is {_either(joints, i, there[i], stated[i])}?"
        yield Mistake(joints.internal([there])[0], what, about="readback", rarer=rarer)


def opposite(joints: JointUnits, joints_deg: tuple[float, ...]) -> Iterator[Mistake]:
    """An angle of the other sign."""
    stated = np.array(joints_deg)
    for i in np.flatnonzero(np.abs(stated) > joints.same()).tolist():
        other = np.where(np.arange(len(stated)) == i, -stated, stated)
        what = f"fit the other sign of an angle: is {_either(joints, i, other[i], stated[i])}?"
        yield Mistake(joints.internal([other])[0], what, about="readback")


def _earlier(
    model: Model, state: CampaignState, pose: str, joints_deg: tuple[float, ...], frf: Frf
) -> Mistake | None:
    """An angle mistyped at one of few poses measured before, where all are likelier so.

    `frf` are the new hits of a pose at `joints_deg`. Each pose is left out in turn; the others are
    fitted by all springs that there may be, which is quick.
    """
    joints, low, band = model.cell.robot.joints, model.low, model.cell.config.modes.band_hz
    if low.nominal is None or len(model.used) > MOST_BEFORE or frf.layout.sensors != TOOL.sensors:
        return None
    known = [*((m.pose, m.joints_deg) for m in model.used), (pose, joints_deg)]
    typed = [[*_setpoint(model, state, *one), *opposite(joints, one[1])] for one in known]
    q, frfs = joints.internal([angles for _, angles in known]), (*model.frfs, frf)
    prior, tolerances = RobotPrior(Repertoire.of(low.nominal, low.priors)), low.tolerances

    def left_out(i: int) -> tuple[float, Mistake | None]:
        others = [k for k in range(len(q)) if k != i]
        search = Search(prior, tuple(frfs[k] for k in others), q[others], band, tolerances)
        fit = RobotPosterior.of(search.freed())
        expected = ExpectedFrfs(fit, band)
        hits = StatedHits(expected, q[i], frfs[i])
        found = hits.instead(typed[i])
        its = max(hits.density[0], hits.strange)
        if found is not None:
            its = expected.density(found.q, frfs[i])[0] - found.rarer
        return fit.found.evidence + its, found

    told = side_by_side(left_out, range(len(q)))
    best = int(np.argmax([value for value, _ in told]))
    found = told[best][1]
    if best == len(model.used) or found is None or told[best][0] < told[-1][0] + LOG_ODDS:
        return None
    return replace(found, pose=known[best][0], about="earlier")


def _either(joints: JointUnits, number: int, one: float, other: float) -> str:
    return (
        f"{joints.names[number]} {joints.text(number, one, 2)} or {joints.text(number, other, 2)}"
    )


def _chains(
    state: CampaignState, expected: ExpectedFrfs, q: np.ndarray, frf: Frf, sure: bool
) -> Iterator[Mistake]:
    """What the tool's chain may show instead; not again what the engineer called right."""
    if frf.layout.sensors != TOOL.sensors:
        return
    answered, within = _called_right(state), expected.posterior.tolerances if sure else None
    for fault in possible(expected.shown(q, frf), within):
        if not any(fault.asked in text for text in answered):
            yield Mistake(q, fault.asked, about="chain", fault=fault)


def _called_right(state: CampaignState) -> tuple[str, ...]:
    """What the engineer was asked of the chain before, where the hits were used then."""
    asked = (m.question for m in state.measurements.values() if m.question is not None)
    return tuple(question.text for question in asked if question.about == "chain")


def _asked(pose: str, off_percent: float, fits: Mistake | None) -> Question:
    if fits is not None and fits.about == "chain":
        text = f"At {pose}, {fits.what} Are these hits right as they are?"
    elif fits is not None and fits.about == "readback":
        text = f"These hits {fits.what} Are the angles right as they are?"
    elif fits is not None and fits.about == "earlier":
        text = (
            f"These hits contradict those of {fits.pose}, and those of {fits.pose} {fits.what} "
            f"Are its angles right as they are?"
        )
    else:
        instead = fits.what if fits else "fit no other known pose either"
        text = (
            f"These hits are {off_percent:.0f} % off the FRFs expected at {pose}; they {instead}. "
            f"Is the robot at {pose}?"
        )
    told = fits or Mistake(np.zeros(0), "")
    return Question(text, off_percent=off_percent, fits=told.pose, about=told.about)
