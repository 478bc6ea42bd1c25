"""What an import asks and tells of new hits while the robot still stands there."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.campaign.events import Imported, MeasuredMode, Question
from planner.campaign.labels import found_modes
from planner.campaign.model import FEW_POSES, Model
from planner.campaign.state import CampaignState, Measurement
from planner.dataset.measure import MeasuredPose
from planner.diagnosis.exponential_window import screen_window
from planner.frf.frf import unreciprocal
from planner.recording.joints import JointUnits
from planner.recording.records import Hit
from planner.recording.repeats import Doubt, doubts, other_size
from planner.words import listed, with_sd

WINDOWED = "an exponential window that the analyser laid over the records"
FAR = 20.0  # times what two readbacks of one pose differ by at most: 10°, 100 mm
CERTAIN = float(np.log(1000.0))  # nats, from which a window is asked about: as of other mistakes


@dataclass(frozen=True, eq=False)
class Claim:
    """The pose that new hits are said to be of, and what was known before they came."""

    model: Model
    state: CampaignState
    pose: str
    joints_deg: tuple[float, ...]

    @property
    def joints(self) -> JointUnits:
        """Of the robot."""
        return self.model.cell.robot.joints

    @property
    def q(self) -> np.ndarray:
        """(dof,) in rad."""
        return self.joints.internal(self.joints_deg)

    @property
    def band_hz(self) -> tuple[float, float]:
        """In which modes are looked for."""
        return self.model.cell.config.modes.band_hz

    @property
    def setpoint_deg(self) -> tuple[float, ...]:
        """Where the robot was sent; `joints_deg` where nothing was proposed."""
        proposal = self.state.proposals.get(self.pose)
        return proposal.joints_deg if proposal else self.joints_deg

    @property
    def displacement(self) -> str:
        """A sentence if the robot stood elsewhere than it was sent; else ""."""
        off = self.joints.apart(self.setpoint_deg, self.joints_deg)
        if not off:
            return ""
        return f"The readback of {self.pose} is up to {off} from its setpoint; the readback counts."


def question_about(claim: Claim, measured: MeasuredPose) -> Question | None:
    """Of the first pose's hits whether the chain can be so; of others, whether pose and chain can.

    `measured` is of the new hits alone; None: nothing is asked.
    """
    known = claim.state.measurements.get(claim.pose)
    if known is not None and known.question is not None:  # answered
        return None
    if (window := _unstated_window(claim, measured)) is not None:
        return window
    if not claim.model.labelled:
        from planner.campaign.chain_mismatch import chain_mismatch  # and SciPy, where it is asked

        return chain_mismatch(claim, measured.frf) or _far_from_setpoint(claim)
    from planner.campaign.pose_mismatch import pose_mismatch

    return pose_mismatch(claim, measured)


def _far_from_setpoint(claim: Claim) -> Question | None:
    """What to ask of a readback far from the pose that was proposed, before FRFs can tell."""
    away = np.abs(np.subtract(claim.setpoint_deg, claim.joints_deg)) / claim.joints.same()
    if np.max(away) < FAR:
        return None
    return Question(f"{claim.displacement} Is the readback right?", about="readback")


def _unstated_window(claim: Claim, measured: MeasuredPose) -> Question | None:
    """What to ask of hits whose noise fades, as under an exponential window that nobody stated."""
    asked = (m.question for m in claim.state.measurements.values() if m.question is not None)
    if claim.model.cell.config.modes.window_rate_1_s or any(WINDOWED in q.text for q in asked):
        return None
    found = screen_window([hit for own in measured.files.hits for hit in own])
    if found is None or found.log_evidence < CERTAIN:
        return None
    rate, sd, _ = found.parameters["rate"]
    text = (
        f"At {claim.pose}, noise fades by {with_sd(rate, sd)} 1/s, as under {WINDOWED}: export "
        f"without it, or state it in campaign.toml ([modes] window_rate_1_s). Are these hits right "
        f"as they are?"
    )
    return Question(text, about="chain")


def contradiction(pose: str, measured: MeasuredPose, known: int) -> Question | None:
    """What to ask of hits that contradict each other; None: nothing.

    The first `known` files of the pose were imported, and asked about, before.
    """
    files = measured.files
    named = [
        (number, source.name, hit)
        for number, (source, own) in enumerate(zip(measured.sources, files.hits, strict=True))
        for hit in own
        if any(hit is kept for kept in files.agreeing)
    ]
    names, hits = [name for _, name, _ in named], tuple(hit for *_, hit in named)
    found = doubts(hits, measured.band_hz) if len(hits) > 1 else ()
    camps: dict[tuple[Doubt | None, tuple[int, ...]], list[int]] = {}
    disagree: dict[str, None] = {}
    for i, doubt in enumerate(found):
        if doubt is None or max(named[j][0] for j in (i, *doubt.others)) < known:
            continue
        # Hits that disagree with the same ones are told together; those of other sizes are not.
        key = (doubt if doubt.size or doubt.along else None), doubt.others
        both = {names[i], *(names[j] for j in doubt.others)}
        if key not in camps and both <= disagree.keys():  # told from the other side
            continue
        disagree |= dict.fromkeys((names[i], *(names[j] for j in doubt.others)))
        camps.setdefault(key, []).append(i)
    told = []
    for (_, others), own in camps.items():
        doubt = found[own[0]]
        assert doubt is not None
        first, rest = (listed([Path(names[j]).name for j in one]) for one in (own, others))
        told.append(_told(hits[own[0]], doubt, first, rest, found[others[0]] is not None))
    if not told:
        return None
    text = (
        f"At {pose} {'; '.join(told)}. To settle it, hit along that axis once more, take this "
        f"import back, and import all hits together. Is each of them right as it is?"
    )
    return Question(text, disagree=tuple(disagree))


def _told(hit: Hit, doubt: Doubt, first: str, others: str, both_doubted: bool) -> str:
    if doubt.size:
        return f"{first}, along {hit.axis[-1]}, {other_size(doubt.size, others).rstrip('?')}"
    if doubt.along:
        return f"{first} is said to be {hit.axis}, but answers as {others} along {doubt.along} did"
    said = f"(correlation {doubt.likeness:.2f})"
    if both_doubted:
        verb = "disagree" if " and " in first else "disagrees"
        return (
            f"along {hit.axis[-1]}, {first} {verb} with {others} {said}, and nothing tells which "
            f"is right"
        )
    return (
        f"{first}, said to be {hit.axis}, disagrees with {others} {said} and answers as hits "
        f"along another axis do"
    )


LEAST_POSES = 3  # measured, before which hints at drift are not to be relied on
SAME_MODE = 0.05  # of ln f: so near, a mode of a second visit is that of the first
# A visit differs from the one before, or all modes from what is expected, beyond so many sds, and
# by so much at least: less matters to nobody.
DIFFERS_SD, SUSPECT_SD, SMALLEST = 3.0, 2.0, 2e-3
LEAST_MODES = 2  # that have to lie to one side


def hit_again(model: Model, known: Measurement, modes: Sequence[MeasuredMode]) -> tuple[str, ...]:
    """A remark on what further hits at a measured pose show beside those before."""
    # Of few poses one that has drifted makes the scatter of visits as large as the drift.
    told = len(model.labelled) >= FEW_POSES
    scatter = np.sqrt(2 * np.mean(model.surrogate.visit_scatter**2)) if told else 0.0
    before = [
        (mode.frequency_hz, float(np.hypot(mode.frequency_sd_hz / mode.frequency_hz, scatter)))
        for mode in known.modes if mode.likely
    ]  # fmt: skip
    found = _found_again(before, modes)
    if not found:
        return ()
    hz, off, sd = max(found, key=lambda one: abs(one[1]) / one[2])
    what = f"the mode at {hz:.2f} Hz by {100 * off:+.2f} %"
    if abs(off) > max(DIFFERS_SD * sd, SMALLEST):
        return (
            f"{known.pose} was hit again and differs from the hits before, {what}, "
            f"{abs(off) / sd:.1f} sd of two visits: the robot has "
            f"changed since. Hit another early pose again; to keep the visits apart, undo this "
            f"import and give the hits a pose name of their own.",
        )
    return (f"{known.pose} was hit again and is as it was (at most {what}).",)


def suspected_drift(claim: Claim, modes: Sequence[MeasuredMode]) -> tuple[str, str]:
    """Which early pose tells whether there is drift that a new pose hints at, and why; else ""s.

    It is a hint only where enough was expected.
    """
    model, state, pose = claim.model, claim.state, claim.pose
    if len(model.labelled) < LEAST_POSES or state.hit_at(pose) is not None:
        return "", ""
    hz, sd = (row[0].tolist() for row in model.frequencies(claim.q[None]))
    expected = [(f, s / f) for f, s in zip(hz, sd, strict=True)]
    found = np.array(_found_again(expected, modes)).reshape(-1, 3)
    off, in_sd = found[:, 1], np.abs(found[:, 1]) / found[:, 2]
    one_sided = abs(np.sum(np.sign(off))) == len(off) >= LEAST_MODES
    if not one_sided or np.any(in_sd < SUSPECT_SD) or np.mean(np.abs(off)) < SMALLEST:
        return "", ""
    # Of the earlier half, since which the robot has changed most, the pose with most modes.
    half = state.used[: (len(state.used) + 1) // 2]
    early = max(half, key=lambda m: sum(mode.likely for mode in m.modes))
    which = "the first pose" if early is state.used[0] else "an early pose"
    return (
        early.pose,
        f"All modes at {pose} lie to one side of what is expected, by {100 * np.mean(off):+.2f} % "
        f"on average: the robot may have drifted (warmth, load, clamping). Hit {early.pose}, "
        f"{which}, again ({claim.joints.listed(early.joints_deg, 3)}) and import with --pose "
        f"{early.pose}: it says whether. It is proposed next.",
    )


def unexpected_modes(before: Model, model: Model, pose: str) -> tuple[str, ...]:
    """A sentence on modes of a pose that lie elsewhere than expected; none where none does.

    `before` expected them, `model` says which they are.
    """
    if not before.labelled:
        return ()
    told = [
        f"mode {one.label} at {one.mode.frequency_hz:.2f} Hz, expected at "
        f"{with_sd(one.expected_hz, one.sd_hz)} Hz ({abs(one.off):.0f} sd off)"
        for one in found_modes(pose, model, before)
        if one.mode is not None and abs(one.off) > DIFFERS_SD
        and abs(one.mode.frequency_hz - one.expected_hz) > SMALLEST * one.expected_hz
    ]  # fmt: skip
    if not told:
        return ()
    return (
        f"Not as expected: {'; '.join(told)}. Modes are numbered from the lowest: one more, or one "
        f"less, shifts all numbers above. If that is not it, an angle of {pose}, or of a pose "
        f"before, may be wrong.",
    )


def _found_again(
    expected: Sequence[tuple[float, float]], modes: Sequence[MeasuredMode]
) -> list[tuple[float, float, float]]:
    """Of each expected frequency (Hz, sd of ln f) near a mode: Hz, ln f of that, and its sd."""
    likely, found = [mode for mode in modes if mode.likely], []
    for hz, sd in expected:
        off = [float(np.log(mode.frequency_hz / hz)) for mode in likely]
        k = int(np.argmin(np.abs(off))) if off else -1
        if k >= 0 and abs(off[k]) < SAME_MODE:
            own = likely[k].frequency_sd_hz / likely[k].frequency_hz
            found.append((hz, off[k], float(np.hypot(sd, own))))
    return found


def alerts(
    claim: Claim,
    event: Imported,
    measured: MeasuredPose,
    modes: Sequence[MeasuredMode],
    drift: str,
) -> tuple[str, ...]:
    """Remarks on new hits, their channels, reciprocity and drift.

    `measured` are all hits of the pose, the new ones last, and `modes` those by the new hits alone;
    `drift` is what is said of it, where they hint at it.
    """
    verdicts = measured.verdicts[-len(event.hits) :]
    told = tuple(dict.fromkeys(text for one in verdicts for text in one.remarks))
    if event.question is not None:
        return told
    if measured.frf is not None:
        told += unreciprocal(measured.frf)
    known = claim.state.hit_at(event.pose)
    if known is not None:
        # Modes of fewer axes are others: what was lacking of a visit is no second one.
        whole = {hit.hit[-1] for hit in event.hits if hit.accepted and hit.hit} >= known.axes
        return told + (hit_again(claim.model, known, modes) if whole else ())
    return (*told, drift) if drift else told
