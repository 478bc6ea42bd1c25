"""Whether hits are of the pose, and by the chain, that they are said to be of.

What was found of the hits before tells which FRFs are to be expected anywhere, and how unsure that
is. Where "something else" is likelier than the pose as stated, what that may be competes by
evidence: another known pose, the setpoint, an angle with the other sign, axes of the sensor
exchanged, a channel with a wrong scale, a sensor that turned, hits the other way or listed along
wrong axes, another tool, a delay, a high-pass, a window or a time base, one joint elsewhere, and a
wrong angle, or another chain, of an earlier pose, which bent what is expected.
Without a simulation, or before the first measurement, nothing is expected.
"""

from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.campaign import alternatives
from planner.campaign.alternatives import LOG_ODDS, Alternative, StatedHits
from planner.campaign.chain_mismatch import chain_mismatch
from planner.campaign.events import Question
from planner.campaign.import_checks import Claim
from planner.campaign.state import CampaignState
from planner.dataset.measure import MeasuredPose
from planner.fit.expected import ExpectedFrfs
from planner.fit.fitted import StructureFit, explains_all
from planner.fit.identified_robot import PLACED, IdentifiedRobot
from planner.fit.posterior import RobotPosterior
from planner.fit.search import Search
from planner.fit.visit_chains import strained
from planner.frf.frf import Frf
from planner.frf.metrics import complex_frac
from planner.inference.parallel import parallel_map
from planner.recording.joints import JointUnits
from planner.recording.points import TOOL
from planner.recording.repeats import LIKE

NEAR_DEG = 2.0  # to the setpoint, in which angles that are none of degrees are recognised
# Measured poses before which another structure may explain what nothing known fits: until then
# the simulation alone tells of the chain, as before the first; no joint is looked for elsewhere.
SURE = 2
ELSEWHERE = Alternative(
    np.zeros(0), "look as if of another pose: without them all others agree.", about="earlier"
)


def pose_mismatch(claim: Claim, measured: MeasuredPose) -> Question | None:
    """What to ask the engineer before new hits of a pose are believed; None: nothing.

    `measured` is of the new hits alone.
    """
    fit, frf = claim.model.low.identified_robot or claim.model.low.rejected, measured.one_hit_frf
    if frf is None or fit is None:
        return None
    expected = ExpectedFrfs(fit.posterior, claim.band_hz)
    q, frf = claim.q, frf.within(expected.band_hz)
    sure, placed = fit.poses >= SURE, fit.poses >= PLACED
    stated = StatedHits(expected, q, frf, placed)
    answered = _called_right(claim.state)
    said = "".join(answered)  # not asked again
    likely = _setpoint(claim)
    if sure and frf.layout == TOOL:
        likely += alternatives.loose(expected, q, placed)
    if stated.agree(likely):
        return None
    mistakes = [*likely, *known_poses(claim, frf)]
    if sure:
        mistakes += alternatives.flipped_signs(claim.joints, claim.joints_deg)
        mistakes += alternatives.joint_offsets(claim.joints, expected, frf, claim.joints_deg)
    mistakes += (m for m in alternatives.chain_faults(expected, q, frf, sure) if m.what not in said)
    fits = stated.best_alternative(mistakes)
    if fits is not None and fits.what in said:
        return None
    # Another known pose, or the setpoint, is none by chance; any angle may be, of this pose or of
    # one before.
    if (
        fits is None
        or (fits.about == "readback" and not fits.rival)
        or StatedHits(expected, fits.q, fits.sound(frf)[0]).doubted
    ):
        fits = _earlier(claim, fit.posterior, frf) or fits
    if fits is None and not stated.impossible:
        return None
    if fits is None and not sure:
        return None if answered else chain_mismatch(claim, measured.frf)
    if _other_before(claim, fit, frf, fits):
        return None  # the import tells of that pose
    return _asked(claim.pose, 100 * expected.off(q, frf), fits)


def known_poses(claim: Claim, frf: Frf) -> Iterator[Alternative]:
    """Where else the robot may be: where it was hit before, if the FRF is like that of then."""
    state, model = claim.state, claim.model
    shown = {m.pose: own for m, own in zip(model.used, model.frfs, strict=True)}
    known = {m.pose: m.joints_deg for m in state.used}
    known |= {name: state.proposals[name].joints_deg for name in state.open}
    known.pop(claim.pose, None)
    for name, there in known.items():
        what = f"fit {name} far better"
        if state.hit_at(name):
            if name in shown and not _alike(frf, shown[name]):
                continue
            what = f"are like those measured at {name}, if those were hit there"
        yield Alternative(claim.joints.internal(there), what, name)


def _alike(frf: Frf, before: Frf) -> bool:
    """Whether two FRFs of the tool are as like as repeated hits are."""
    both = frf.measured & before.measured if frf.layout == before.layout == TOOL else None
    if both is None or not both.any():
        return True
    hz, ours = frf.frequency_hz, frf.accelerance[:, both]
    at = np.abs(before.frequency_hz - hz[:, None]).argmin(axis=1)  # the nearest line
    theirs = before.accelerance[:, both][..., at]
    return bool(complex_frac(ours.ravel(), theirs.ravel()) > LIKE**2)


def _setpoint(claim: Claim) -> list[Alternative]:
    """Where the robot was sent, where that is not what is stated."""
    joints, pose = claim.joints, claim.pose
    sent, joints_deg = claim.setpoint_deg, claim.joints_deg
    typed = np.flatnonzero(np.abs(np.subtract(sent, joints_deg)) > joints.same()).tolist()
    which = " ".join(alternatives.instead(joints, i, sent[i], joints_deg[i]) for i in typed)
    what = f"fit the setpoint of {pose} ({which.rstrip(',')}) better than its readback."
    if np.all(np.abs(np.rad2deg(joints_deg) - sent) < NEAR_DEG):
        what = f"fit the setpoint of {pose} better than its readback: are its angles in radians?"
    there = Alternative(joints.internal(sent), what, about="readback", rival=True)
    return [there] if typed else []


def _earlier(claim: Claim, found: RobotPosterior, frf: Frf) -> Alternative | None:
    """An angle mistyped at a pose measured before, where all are likelier so.

    `frf` are the new hits, `found` what the model says of the robot without them.
    """
    if frf.layout.sensors != TOOL.sensors:
        return None
    used = claim.model.used
    every = [*(replace(claim, pose=m.pose, joints_deg=m.joints_deg) for m in used), claim]
    q, frfs = np.array([one.q for one in every]), (*claim.model.frfs, frf)
    poses = PosesTogether(found, claim.band_hz, claim.joints, q, frfs)
    asked = [(m.pose, m.question) for m in used if m.question is not None]
    right = {a.fits or name for name, a in asked if a.about in ("readback", "earlier")}
    answered = [i for i, one in enumerate(every[:-1]) if one.pose in right]
    wrong = poses.wrong([_setpoint(one) for one in every], answered)
    return replace(wrong[1], pose=every[wrong[0]].pose, about="earlier") if wrong else None


def _other_before(claim: Claim, fit: IdentifiedRobot, frf: Frf, fits: Alternative | None) -> bool:
    """Whether a pose before, not this one, was measured by another chain than the others.

    It has bent what is expected, where few poses were measured; all together tell whose it was.
    """
    few = SURE <= fit.poses <= PLACED and frf.layout.sensors == TOOL.sensors
    of_chain, known = fits is None or fits.about == "chain", fit.posterior
    if not (few and of_chain and strained(known.found)):
        return False
    q = [claim.joints.internal(m.joints_deg) for m in claim.model.used]
    q, frfs = np.array([*q, claim.q]), (*claim.model.frfs, frf)
    search = Search(known.structure.prior, frfs, q, claim.band_hz, known.tolerances)
    found = search.found(known.found.remembered)
    *before, here = np.atleast_1d(found.misfit.data.multiples)
    return explains_all(found) and here == 1.0 < max(before)


def _called_right(state: CampaignState) -> tuple[str, ...]:
    """What the engineer was asked of the chain before, where the hits were used then."""
    asked = (m.question for m in state.measurements.values() if m.question is not None)
    return tuple(question.text for question in asked if question.about == "chain")


def _asked(pose: str, off_percent: float, fits: Alternative | None) -> Question:
    if fits is not None and fits.about == "chain":
        text = f"At {pose}, {fits.what} Are these hits right as they are?"
    elif fits is not None and fits.about == "readback":
        text = f"These hits {fits.what} Are the stated angles right?"
    elif fits is not None and fits.about == "earlier":
        again = fits.pose == pose
        those = f"those of {fits.pose}" + (" before" if again else "")
        whose = "the files and angles given then" if again else "its files and angles"
        text = (
            f"These hits contradict {those}, and {those} {fits.what} Are {whose} right as they are?"
        )
    else:
        instead = fits.what if fits else "fit no other known pose either"
        text = (
            f"These hits are {off_percent:.0f} % off the FRFs expected at {pose}; they {instead}. "
            f"Is the robot at {pose}?"
        )
    told = fits or Alternative(np.zeros(0), "")
    return Question(text, off_percent=off_percent, fits=told.pose, about=told.about)


@dataclass(frozen=True, eq=False)
class PosesTogether:
    """Hits of poses q (n, dof) in rad, the new one last, that do not agree: which one is wrong?

    Each is held against what the others alone let expect, and all are fitted with each angle that
    they fit better: by all springs that there may be and the other effects that `found` has, which
    is quick.
    """

    found: RobotPosterior
    band_hz: tuple[float, float]
    joints: JointUnits
    q: np.ndarray
    frfs: tuple[Frf, ...]

    def wrong(
        self, likely: Sequence[Sequence[Alternative]], answered: Container[int] = ()
    ) -> tuple[int, Alternative] | None:
        """The earlier pose, and its angle, with which all is explained, and likelier than as
        stated, or with any angle of the new pose; or the one without which all others agree.

        Of the first ones, that is: what came later was asked about when it came. `likely` are each
        pose's own alternatives; the angles of those `answered` are right.
        """
        new = len(self.q) - 1
        tried = [*(i for i in range(min(new, PLACED)) if i not in answered), new]
        each = parallel_map(lambda i: self._set_aside(i, likely[i]), tried)
        angles = [(i, angle) for i, (_, angle) in zip(tried, each, strict=True) if angle]
        (stated, _), *together = parallel_map(self._evidence, [None, *angles])
        found = [(*one, *which) for one, which in zip(together, angles, strict=True)]
        found += [(*alone, i, ELSEWHERE) for i, (alone, _) in zip(tried, each, strict=True)]
        (most, explains, i, how), *others = sorted(found, key=lambda one: one[0], reverse=True)
        least = max([stated, *(value for value, _, k, _ in others if k == new)])
        return (i, how) if i < new and explains and most > least + LOG_ODDS else None

    def _fit(self, q: np.ndarray, poses: Sequence[int]) -> StructureFit:
        """Of some of the poses, at q (n, dof)."""
        frfs, p = tuple(self.frfs[k] for k in poses), self.found
        prior = p.structure.prior
        return Search(prior, frfs, q[list(poses)], self.band_hz, p.tolerances).freed(p)

    def _set_aside(
        self, i: int, likely: Sequence[Alternative]
    ) -> tuple[tuple[float, bool], Alternative | None]:
        """Evidence with one pose elsewhere, wherever that is, and whether the others then agree;
        the angle by which it fits them better, None where none does."""
        others = [k for k in range(len(self.q)) if k != i]
        fit = self._fit(self.q, others)
        expected = ExpectedFrfs(RobotPosterior.of(fit), self.band_hz)
        stated = tuple(self.joints.shown(self.q[i]))
        hits = StatedHits(expected, self.q[i], self.frfs[i], len(others) >= PLACED)
        typed = [*likely, *alternatives.flipped_signs(self.joints, stated)]
        if len(others) >= SURE and not hits.agree():
            typed += alternatives.joint_offsets(self.joints, expected, self.frfs[i], stated)
        agree = len(others) >= SURE and explains_all(fit)
        # Where the others know what it should show, it is elsewhere only if it does not show that.
        agree = agree and (hits.doubted or not hits.placed)
        alone = fit.evidence + hits.outlier_log_density, agree
        return alone, hits.best_alternative(typed)

    def _evidence(self, one: tuple[int, Alternative] | None) -> tuple[float, bool]:
        """Of all together, with one pose's other angle, and whether that explains them."""
        q, rarer = self.q.copy(), 0.0
        if one is not None:
            q[one[0]], rarer = one[1].q, one[1].rarer
        found = self._fit(q, range(len(q)))
        return found.evidence - rarer, explains_all(found)
