"""What may be wrong with hits that are not as expected, and how well that explains them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.campaign.chain_faults import FILTERS, NONE, ChainFault, possible
from planner.fit.expected import LINES, SIZES, ExpectedFrfs
from planner.frf.frf import Frf
from planner.inference.parallel import parallel_map
from planner.recording.joints import JointUnits
from planner.recording.points import TOOL

LOG_ODDS = np.log(1000.0)  # against a mistake, before anything is measured
CERTAIN = 50.0  # nats where evidence alone tells: chance gave 104 good imports up to 42
BETTER = 3.0  # times less is left by a mistake that explains them
# What one number describes is looked for at 2 to 64 times what it is, or may be, where nothing is
# wrong: a joint beside its readback, a delay, the corner of a high-pass and the rate of a window.
STEPS = 2.0 ** np.arange(1, 7)
FINE = 0.02  # of where it is likeliest: so finely that is told
NO_RECORD = 1e6  # times |H| is off what no record can show
# Times farther than is stated hits may have struck, or joints may stand; and sds of a body's
# inertia by which a tool may be another.
MUCH = 10.0
FAR_OFF_HITS = (
    "hits look struck far beside the tool's tip, or slanted: was it that point, and along its axes?"
)
OTHER_TOOL = (
    "the load on the last joint differs from that at the poses before: was the tool changed (a "
    "campaign is of one tool), or does something hang on it?"
)
FOLLOWED = 3  # mistakes that are fitted beside rivals, those that seem likeliest at once


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

    def sound(self, frf: Frf) -> tuple[Frf, float]:
        """An FRF, of whichever sensors, as a sound chain would show it; see `ChainFault`."""
        return (frf, 0.0) if self.fault is NONE else self.fault.undone(frf)


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
        far_off = replace(self.expected, joint_times=MUCH)
        # Joints that stand far beside their readback: which one does is worth a search.
        far = [Alternative(self.q, "", rival=True, expected=far_off)] if self.placed else []
        return not self.doubted and self.best_alternative([*likely, *far]) is None

    def best_alternative(self, mistakes: Sequence[Alternative]) -> Alternative | None:
        """The mistake that explains the hits, by evidence and size; None where none does."""
        columns = int(np.count_nonzero(self.frf.measured))
        value, size = self.density

        def shown(one: Alternative) -> tuple[Frf, float]:
            frf, volume = one.sound(self.frf)
            return frf, volume * columns * LINES

        def glanced(one: Alternative) -> float:
            frf, volume = shown(one)
            return (
                (one.expected or self.expected).outlier_log_density(one.q, frf) + volume - one.rarer
            )

        fitted = []
        others = [one for one in mistakes if not one.rival]
        likeliest = sorted(others, key=glanced, reverse=True)[:FOLLOWED]
        for one in (*(one for one in mistakes if one.rival), *likeliest):
            frf, volume = shown(one)
            its, left = (one.expected or self.expected).density(one.q, frf)
            gain = its + volume - one.rarer - value
            # Where as little is left as may be, evidence alone tells of a joint.
            told = self.placed and size == SIZES[-1] and one.about == "readback"
            alone = (one.rival and not self.impossible) or (told and gain > CERTAIN)
            better = (1 if alone else BETTER) * left <= size
            explains = better or its + volume > self.outlier_log_density > value
            # Once one explains them, another is told where it is so much likelier still.
            fitted.append((gain - (0.0 if explains else LOG_ODDS), explains, one))
        if not any(explains and gain > LOG_ODDS for gain, explains, _ in fitted):
            return None
        return max(fitted, key=lambda each: each[0])[-1]


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
            what = f"fit {instead(joints, i, angle, stated[i])} far better."
            yield Alternative(there(i, by), what, about="readback", rarer=_rarer(len(axes)))


def chain_faults(
    expected: ExpectedFrfs, q: np.ndarray, frf: Frf, sure: bool
) -> Iterator[Alternative]:
    """What the tool's chain may show instead at q (dof,) in rad."""
    if frf.layout.sensors != TOOL.sensors:
        return
    for fault in possible(expected.shown(q, frf), expected.posterior.tolerances, sure):
        yield Alternative(q, fault.asked, about="chain", fault=fault)
    for kind in FILTERS if sure else ():

        def less(by: float, kind: Callable[[float], ChainFault] = kind) -> float:
            shown, _ = kind(by).undone(frf)
            return expected.off_by_line(q, shown) if shown.exponential_rate_1_s >= 0 else NO_RECORD

        by = _best(less)
        if by:
            fault = kind(by)
            yield Alternative(
                q, fault.asked, about="chain", fault=fault, rarer=_rarer(len(FILTERS))
            )


def loose(expected: ExpectedFrfs, q: np.ndarray, placed: bool) -> list[Alternative]:
    """Hits of another point, or slanted; where `placed`, a tool that was changed, or loaded, too.

    They take it up as they are, so nothing else is wrong. So free numbers take up what springs do
    from visit to visit, too: evidence has to be certain.
    """
    free = [(FAR_OFF_HITS, replace(expected, times=MUCH))]
    free += [(OTHER_TOOL, replace(expected, tool_sds=MUCH))] if placed else []
    return [
        Alternative(q, what, about="chain", rival=True, rarer=CERTAIN, expected=one)
        for what, one in free
    ]


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
        what = f"fit {instead(joints, i, other[i], stated[i])} far better: a wrong sign?"
        yield Alternative(joints.internal([other])[0], what, about="readback")


def instead(joints: JointUnits, number: int, fits: float, stated: float) -> str:
    """A joint's angle that hits fit, and the one that is stated."""
    name, text = joints.names[number], joints.text
    return f"{name} at {text(number, fits, 2)}, not at {text(number, stated, 2)} as stated,"
