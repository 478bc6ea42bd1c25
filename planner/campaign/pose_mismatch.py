"""Whether hits are of the pose, and by the chain, that they are said to be of.

What was found of the hits before tells which FRFs are to be expected anywhere, and how unsure that
is. Where "something else" is likelier than the pose as stated, what that may be competes by
evidence: another known pose, the setpoint, an angle with the other sign, axes of the sensor
exchanged, a channel with a wrong scale, a sensor that turned, hits the other way or listed along
wrong axes, a delay, a high-pass or a window, one joint elsewhere, and a wrong angle of an earlier
pose, which bent what is expected.
Without a simulation, or before the first measurement, nothing is expected.
"""

from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.campaign.chain_faults import FILTERS, NONE, ChainFault, possible
from planner.campaign.chain_mismatch import chain_mismatch
from planner.campaign.events import Question
from planner.campaign.model import Model
from planner.campaign.state import CampaignState
from planner.dataset.measure import MeasuredPose
from planner.fit.expected import LINES, SIZES, ExpectedFrfs
from planner.fit.identified_robot import PLACED
from planner.fit.posterior import RobotPosterior
from planner.fit.search import Search
from planner.frf.frf import Frf
from planner.inference.parallel import parallel_map
from planner.recording.joints import JointUnits
from planner.recording.points import TOOL

LOG_ODDS = np.log(1000.0)  # against a mistake, before anything is measured
CERTAIN = 50.0  # nats where evidence alone tells: chance gave 104 good imports up to 42
BETTER = 3.0  # times less is left by a mistake that explains them
# Measured poses before which another structure may explain what nothing known fits: until then
# the simulation alone tells of the chain, as before the first; no joint is looked for elsewhere.
SURE = 2
# What one number describes is looked for at 2 to 64 times what it is, or may be, where nothing is
# wrong: a joint beside its readback, a delay, the corner of a high-pass and the rate of a window.
STEPS = 2.0 ** np.arange(1, 7)
FINE = 0.02  # of where it is likeliest: so finely that is told
MUCH = 10.0  # times farther than is stated hits may have struck, or joints may stand
FAR_OFF_HITS = (
    "hits look struck far beside the tool's tip, or slanted: was it that point, and along its axes?"
)
FOLLOWED = 3  # mistakes that are fitted, those that seem likeliest at once


@dataclass(frozen=True, eq=False)
class Alternative:
    """Where the robot may be, q (dof,) in rad, and what the chain may show, instead; in words.

    `expected` is what else is to be expected of hits that miss by far more than `[hits]` says. A
    `rival` is likelier beforehand than others: it need not leave less than what is stated. One
    chosen among many that can be told apart is `rarer` by so many nats.
    """

    q: np.ndarray
    what: str
    pose: str = ""
    about: str = ""
    fault: ChainFault = NONE
    rival: bool = False
    rarer: float = 0.0
    expected: ExpectedFrfs | None = None


def pose_mismatch(
    model: Model,
    state: CampaignState,
    pose: str,
    joints_deg: tuple[float, ...],
    measured: MeasuredPose,
) -> Question | None:
    """What to ask the engineer before new hits of a pose are believed; None: nothing.

    `measured` is of the new hits alone; `model` and `state` are those before the import.
    """
    fit, frf = model.low.identified_robot or model.low.rejected, measured.one_hit_frf
    if frf is None or fit is None:
        return None
    expected = ExpectedFrfs(fit.posterior, model.cell.config.modes.band_hz)
    joints = model.cell.robot.joints
    q, frf = joints.internal([joints_deg])[0], frf.within(expected.band_hz)
    sure, placed = fit.poses >= SURE, fit.poses >= PLACED
    stated = StatedHits(expected, q, frf, placed)
    answered = _called_right(state)
    said = "".join(answered)  # not asked again
    likely = _setpoint(model, state, pose, joints_deg)
    if sure and frf.layout == TOOL and FAR_OFF_HITS not in said:
        likely.append(far_off_hits(expected, q))
    if stated.agree(likely):
        return None
    mistakes = [*likely, *_poses(model, state, pose, joints_deg)]
    if sure:
        mistakes += flipped_signs(joints, joints_deg)
        mistakes += joint_offsets(joints, expected, frf, joints_deg)
    mistakes += (m for m in chain_faults(expected, q, frf, sure) if m.what not in said)
    fits = stated.best_alternative(mistakes)
    # Another known pose is none by chance; any angle may be, of the pose or of one before.
    if (
        fits is None
        or fits.about == "readback"
        or (fits.about != "chain" and StatedHits(expected, fits.q, frf).doubted)
    ):
        fits = _earlier(model, state, pose, joints_deg, frf) or fits
    if fits is None and not stated.impossible:
        return None
    if fits is None and not sure:
        return None if answered else chain_mismatch(model, pose, joints_deg, measured.frf)
    return _asked(pose, 100 * expected.off(q, frf), fits)


@dataclass(frozen=True, eq=False)
class StatedHits:
    """Hits as they are said to be: of q (dof,) in rad, by a chain as it should be.

    `placed`: so many poses were measured that what was found is where it was found.
    """

    expected: ExpectedFrfs
    q: np.ndarray
    frf: Frf
    placed: bool = False

    @cached_property
    def outlier_log_density(self) -> float:
        """Log density of something else."""
        return self.expected.outlier_log_density(self.q, self.frf)

    @cached_property
    def density(self) -> tuple[float, float]:
        """Log density as stated, and the size of the discrepancy that it takes."""
        return self.expected.density(self.q, self.frf)

    @property
    def impossible(self) -> bool:
        """Whether it is something else, whatever that is."""
        return self.outlier_log_density - self.density[0] > LOG_ODDS

    @property
    def doubted(self) -> bool:
        """Whether a mistake may explain it better."""
        return self.impossible or self.density[1] >= BETTER * SIZES[-1]

    def agree(self, likely: Sequence[Alternative] = ()) -> bool:
        """Whether nothing is to be asked: no mistake, of those `likely` beforehand none at all."""
        far = [readback_errors(self.expected, self.q)] if self.placed else []
        return not self.doubted and self.best_alternative([*likely, *far]) is None

    def best_alternative(self, mistakes: Sequence[Alternative]) -> Alternative | None:
        """The mistake that explains the hits, by evidence and size; None where none does."""
        columns = int(np.count_nonzero(self.frf.measured))
        value, size = self.density

        def shown(one: Alternative) -> tuple[Frf, float]:
            if one.fault is NONE:  # of whichever sensors
                return self.frf, 0.0
            frf, volume = one.fault.undone(self.frf)
            return frf, volume * columns * LINES

        def glanced(one: Alternative) -> float:
            frf, volume = shown(one)
            return (
                (one.expected or self.expected).outlier_log_density(one.q, frf) + volume - one.rarer
            )

        found = []
        for one in sorted(mistakes, key=glanced, reverse=True)[:FOLLOWED]:
            frf, volume = shown(one)
            its, left = (one.expected or self.expected).density(one.q, frf)
            gain = its + volume - one.rarer - value
            # Where as little is left as may be, evidence alone tells of a joint.
            told = self.placed and size == SIZES[-1] and one.about == "readback"
            alone = one.rival or (told and gain > CERTAIN)
            better = (1 if alone else BETTER) * left <= size
            if gain > LOG_ODDS and (better or its + volume > self.outlier_log_density > value):
                found.append((gain, one))
        return max(found, key=lambda pair: pair[0], default=(0.0, None))[1]


def _poses(
    model: Model, state: CampaignState, pose: str, joints_deg: tuple[float, ...]
) -> Iterator[Alternative]:
    """Where else the robot may be."""
    joints = model.cell.robot.joints
    known = {m.pose: m.joints_deg for m in state.used}
    known |= {name: state.proposals[name].joints_deg for name in state.open}
    known.pop(pose, None)
    for name, there in known.items():
        what = f"repeat those of {name}" if state.hit_at(name) else f"fit {name} far better"
        yield Alternative(joints.internal([there])[0], what, name)


def _setpoint(
    model: Model, state: CampaignState, pose: str, joints_deg: tuple[float, ...]
) -> list[Alternative]:
    """Where the robot was sent, where that is not what is stated."""
    joints = model.cell.robot.joints
    sent = state.proposals[pose].joints_deg if pose in state.proposals else joints_deg
    typed = np.flatnonzero(np.abs(np.subtract(sent, joints_deg)) > joints.same()).tolist()
    which = ", ".join(_either(joints, i, sent[i], joints_deg[i]) for i in typed)
    what = f"fit the setpoint of {pose} better than its readback: is {which}?"
    there = joints.internal([sent])[0]
    return [Alternative(there, what, about="readback", rival=True)] if typed else []


def joint_offsets(
    joints: JointUnits, expected: ExpectedFrfs, frf: Frf, joints_deg: tuple[float, ...]
) -> Iterator[Alternative]:
    """One joint where it explains the hits best, near its angle.

    `joints_deg` (dof,) as stated: degrees, of slides mm.
    """
    stated, same = np.array(joints_deg), joints.same()
    axes = np.diag(same)

    def there(i: int, by: float) -> np.ndarray:
        return joints.internal([stated + by * axes[i]])[0]

    def best(i: int) -> float:
        return _best(lambda by: -expected.outlier_log_density(there(i, by), frf))

    for i, by in enumerate(parallel_map(best, range(len(axes)))):
        if by:
            angle = stated[i] + by * same[i]
            what = f"fit another angle far better: is {_either(joints, i, angle, stated[i])}?"
            yield Alternative(there(i, by), what, about="readback", rarer=_rarer(len(axes)))


def chain_faults(
    expected: ExpectedFrfs, q: np.ndarray, frf: Frf, sure: bool
) -> Iterator[Alternative]:
    """What the tool's chain may show instead at q (dof,) in rad."""
    if frf.layout.sensors != TOOL.sensors:
        return
    within = expected.posterior.tolerances if sure else None
    for fault in possible(expected.shown(q, frf), within):
        yield Alternative(q, fault.asked, about="chain", fault=fault)
    for kind in FILTERS if sure else ():

        def less(by: float, kind: Callable[[float], ChainFault] = kind) -> float:
            shown, _ = kind(by).undone(frf)
            return expected.off_by_line(q, shown) if shown.exponential_rate_1_s >= 0 else np.inf

        by = _best(less)
        if by:
            fault = kind(by)
            yield Alternative(
                q, fault.asked, about="chain", fault=fault, rarer=_rarer(len(FILTERS))
            )


def far_off_hits(expected: ExpectedFrfs, q: np.ndarray) -> Alternative:
    """Hits of another point, or slanted: they take it up as they are, so nothing else is wrong."""
    return Alternative(
        q, FAR_OFF_HITS, about="chain", rival=True, expected=replace(expected, times=MUCH)
    )


def readback_errors(expected: ExpectedFrfs, q: np.ndarray) -> Alternative:
    """The joints stand far beside their readback: which one does is worth a search."""
    return Alternative(q, "", rival=True, expected=replace(expected, joint_times=MUCH))


def _best(less: Callable[[float], float]) -> float:
    """By how many units (`STEPS`) hits are explained best; 0: as stated."""
    from scipy.optimize import minimize_scalar  # 0.6 s, which good hits do not need

    tried = np.concatenate([-STEPS[::-1], [0.0], STEPS])
    best = int(np.argmin([less(float(by)) for by in tried]))
    if tried[best] == 0.0:
        return 0.0
    around = tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)]
    fine = {"xatol": FINE * abs(tried[best])}
    by = float(minimize_scalar(less, bounds=around, method="bounded", options=fine).x)
    return by if abs(by) >= STEPS[0] else 0.0


def _rarer(kinds: int) -> float:
    """Nats that one of so many, at one of many places, is rarer than a thing of its own."""
    return float(np.log(2 * STEPS[-1] * kinds))


def flipped_signs(joints: JointUnits, joints_deg: tuple[float, ...]) -> Iterator[Alternative]:
    """An angle of the other sign."""
    stated = np.array(joints_deg)
    for i in np.flatnonzero(np.abs(stated) > joints.same()).tolist():
        other = np.where(np.arange(len(stated)) == i, -stated, stated)
        what = f"fit the other sign of an angle: is {_either(joints, i, other[i], stated[i])}?"
        yield Alternative(joints.internal([other])[0], what, about="readback")


@dataclass(frozen=True, eq=False)
class PosesTogether:
    """Hits of poses q (n, dof) in rad, the new one last, that do not agree: which one is wrong?

    Each is left out in turn, and held against what the others alone let expect: fitted by all
    springs that there may be and the other effects that `found` has, which is quick.
    """

    found: RobotPosterior
    band_hz: tuple[float, float]
    joints: JointUnits
    q: np.ndarray
    frfs: tuple[Frf, ...]

    def wrong(
        self, likely: Sequence[Sequence[Alternative]], answered: Container[int] = ()
    ) -> tuple[int, Alternative] | None:
        """The earlier pose, and its angle, by which all are likelier than by any of the new one.

        Of the first ones, that is: what came later was asked about when it came. `likely` are each
        pose's own alternatives; the angles of those `answered` are right.
        """
        new = len(self.q) - 1
        tried = [*(i for i in range(min(new, PLACED)) if i not in answered), new]
        told = parallel_map(lambda i: self._left_out(i, likely[i]), tried)
        value, i, angle = max(
            ((value, i, angle) for i, (value, angle) in zip(tried, told, strict=True)),
            key=lambda one: one[0],
        )
        if angle is None or i == new or value < told[-1][0] + LOG_ODDS:
            return None
        return i, angle

    def _left_out(self, i: int, likely: Sequence[Alternative]) -> tuple[float, Alternative | None]:
        """Log density of all with the likeliest angle of one, and that, where it is not as
        stated."""
        others, p = [k for k in range(len(self.q)) if k != i], self.found
        frfs = tuple(self.frfs[k] for k in others)
        search = Search(p.structure.prior, frfs, self.q[others], self.band_hz, p.tolerances)
        fit = RobotPosterior.of(search.freed(p))
        expected, angles = ExpectedFrfs(fit, self.band_hz), tuple(self.joints.shown(self.q[i]))
        hits = StatedHits(expected, self.q[i], self.frfs[i], len(others) >= PLACED)
        typed = [*likely, *flipped_signs(self.joints, angles)]
        if len(others) >= SURE and not hits.agree():
            typed += joint_offsets(self.joints, expected, self.frfs[i], angles)
        found = hits.best_alternative(typed)
        its = max(hits.density[0], hits.outlier_log_density)
        if found is not None:
            its = expected.density(found.q, self.frfs[i])[0] - found.rarer
        return fit.found.evidence + its, found


def _earlier(
    model: Model, state: CampaignState, pose: str, joints_deg: tuple[float, ...], frf: Frf
) -> Alternative | None:
    """An angle mistyped at a pose measured before, where all are likelier so.

    `frf` are the new hits of a pose at `joints_deg`.
    """
    joints, fit = model.cell.robot.joints, model.low.identified_robot or model.low.rejected
    if fit is None or frf.layout.sensors != TOOL.sensors:
        return None
    known = [*((m.pose, m.joints_deg) for m in model.used), (pose, joints_deg)]
    q = joints.internal([angles for _, angles in known])
    poses = PosesTogether(
        fit.posterior, model.cell.config.modes.band_hz, joints, q, (*model.frfs, frf)
    )
    asked = [(m.pose, m.question) for m in model.used if m.question is not None]
    right = {a.fits or name for name, a in asked if a.about in ("readback", "earlier")}
    answered = [i for i, (name, _) in enumerate(known[:-1]) if name in right]
    found = poses.wrong([_setpoint(model, state, *one) for one in known], answered)
    return replace(found[1], pose=known[found[0]][0], about="earlier") if found else None


def _either(joints: JointUnits, number: int, one: float, other: float) -> str:
    return (
        f"{joints.names[number]} {joints.text(number, one, 2)} or {joints.text(number, other, 2)}"
    )


def _called_right(state: CampaignState) -> tuple[str, ...]:
    """What the engineer was asked of the chain before, where the hits were used then."""
    asked = (m.question for m in state.measurements.values() if m.question is not None)
    return tuple(question.text for question in asked if question.about == "chain")


def _asked(pose: str, off_percent: float, fits: Alternative | None) -> Question:
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
    told = fits or Alternative(np.zeros(0), "")
    return Question(text, off_percent=off_percent, fits=told.pose, about=told.about)
