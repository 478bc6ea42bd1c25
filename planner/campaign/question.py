"""Whether hits can be from the pose they are said to be from: measured modes against expected.

Hits that answer as another measured pose did, though these poses are expected to differ, are asked
about at any count of poses. The rest is calibrated on the shipped plane and on five true robots,
from three measured poses on. Of 6992 times
that a model judged a pose's own hits it asked never, and once when two modes were left out. Of
hits under another pose's name, where a frequency differs by 2 %, it asks for 99 % on the plane and
91 to 99 % in joint boxes, if the simulation learns and can have the physics; for a third on the
plane with a frozen one, a tenth with none, and for none in joint boxes where no simulation fits:
the model is not sure enough there (all of this by frequencies alone). Poses whose frequencies are
alike differ in how their modes answer at the tool: residues are held against the simulation's, and
alike poses are asked about too. After one and two poses frequencies alone are held against the
model: a pose's own hits were within 7 sd then, of 330 times on robots whose simulations lack
physics of any size or are not fitted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.campaign.events import MeasuredMode, Question
from planner.campaign.labels import ABOVE
from planner.campaign.log_conversion import to_mode
from planner.campaign.model import Model
from planner.campaign.state import CampaignState
from planner.dynamics.vibration import SimulatedModes
from planner.inference.assignment import least_cost
from planner.modal.modes import Mode

LEAST = 3  # measured poses before which residues are not to be relied on, nor slight hints at drift
# Off is what lies further than both. Right poses are within 2.2 sd where the simulation fits
# (without it up to 23 in one mode, 7 in two); what changes from day to day stays below 2 %.
FAR_SD, FAR = 10.0, 0.02
# Of ln f: no pose is so far from where a mode was expected; that mode was not found.
NOT_FOUND = 0.25
MANY = 3  # modes that are not missed all at once
FITS_SD = 5.0  # in every mode, at a pose that is named as where the robot may be instead
# Of residues, relative, on average over the modes that are near where they are expected. Right
# poses differ by 0.03 to 0.22 (hits tilted by 2°; in one arm that no simulation fits by 0.45 at
# most), other poses by 1 as a rule. Chosen between, on generated arms. A simulation that does worse
# at the measured poses is to be off by that much more than it is there.
ANSWERS_OTHERWISE, MORE_THAN_THERE = 0.5, 3.0
# Of ln f: by no more do visits to one pose differ, in every mode and beside what noise leaves open.
SAME_POSE, SAME_POSE_SD, LEAST_MODES = 3e-3, 3.0, 2
TOGETHER = 0.08  # of ln f: modes so close mix, and answer together
AS_STRONG = 0.5  # share of a missing mode's residues above which another was found in its stead


@dataclass(frozen=True, eq=False)
class Comparison:
    """Measured less expected, ln f (count,), and the sd of that; NaN where a mode is missing.

    `otherwise` (count,) is by how much residues differ from the simulation's, relative, NaN where
    a mode is not near, and `limit` from where on that is another pose; `instead` (count,): another
    mode, which nothing explains, was found where a strong one is missing.
    """

    off: np.ndarray
    sd: np.ndarray
    otherwise: np.ndarray
    instead: np.ndarray
    limit: float = ANSWERS_OTHERWISE

    @property
    def in_sd(self) -> np.ndarray:
        """How far off each mode (count,) is, in sd."""
        return np.abs(self.off) / self.sd

    @property
    def far(self) -> np.ndarray:
        """Which modes (count,) are off."""
        return (self.in_sd > FAR_SD) & (np.abs(self.off) > FAR)

    def contradicts(self, sure: bool) -> bool:
        """Whether the pose is to be asked for; one mode is enough where the model is `sure`.

        Elsewhere a mode that was not found, or that veers, can look like one that is off.
        """
        found, far = np.isfinite(self.off), self.far
        near = far & ((np.abs(self.off) < NOT_FOUND) | self.instead)
        nothing_fits = sure and found.sum() >= 2 and bool(np.all(far[found]))
        away = nothing_fits or far.sum() >= MANY or int(near.sum()) >= (1 if sure else 2)
        return away or self.answers_otherwise

    @property
    def difference(self) -> float:
        """Of residues, on average; NaN where nothing is known."""
        known = self.otherwise[np.isfinite(self.otherwise)]
        return float(np.mean(known)) if known.size else np.nan

    @property
    def answers_otherwise(self) -> bool:
        """Whether the modes that are near answer unlike what is expected at the tool."""
        return self.difference > self.limit

    @property
    def log_density(self) -> float:
        """Of the measured modes; what is off counts as FAR_SD."""
        size = np.minimum(np.nan_to_num(self.in_sd, nan=FAR_SD), FAR_SD)
        return float(-np.sum(size**2 / 2 + np.log(np.nan_to_num(self.sd, nan=FAR))))

    @property
    def fits(self) -> bool:
        """Whether all that was found agrees."""
        found = np.isfinite(self.off)
        near = bool(found.any() and np.all(self.in_sd[found] < FITS_SD))
        return near and not self.answers_otherwise


def compare(
    expected_hz: np.ndarray,
    sd_hz: np.ndarray,
    modes: tuple[MeasuredMode, ...],
    simulated: SimulatedModes | None = None,
) -> Comparison:
    """Expected (count,) with sd in Hz against measured modes, paired so that most agree.

    `simulated` are modes of that pose alone, those counted and some above; None: not known.
    """
    likely = [mode for mode in modes if mode.likely]
    hz = np.array([mode.frequency_hz for mode in likely])
    own = np.array([mode.frequency_sd_hz for mode in likely])
    off = np.log(hz[None, :] / expected_hz[:, None])
    sd = np.hypot((sd_hz / expected_hz)[:, None], (own / hz)[None, :])
    # Capped: a mode that was not found costs one pair, not a shift of all pairs above it.
    cost = np.minimum(np.abs(off) / sd, FAR_SD) + np.abs(off)
    rows, columns = least_cost(np.where(np.isfinite(cost), cost, 2 * FAR_SD))
    paired = np.full((3, len(expected_hz)), np.nan)
    paired[0, rows], paired[1, rows] = off[rows, columns], sd[rows, columns]
    instead = np.zeros(len(expected_hz), dtype=bool)
    if simulated is not None:
        measured = np.array([to_mode(mode).residue for mode in likely])
        there, theirs = simulated.frequency_hz[0], simulated.residue[0]
        for k, j in zip(rows.tolist(), columns.tolist(), strict=True):
            if abs(off[k, j]) < TOGETHER:
                expected = _together(there, theirs, float(there[k]))
                paired[2, k] = _difference(expected, _together(hz, measured, float(hz[j])))
            elif abs(off[k, j]) >= NOT_FOUND:
                unexplained = np.nanmin(np.abs(np.log(hz[j] / there))) > TOGETHER
                instead[k] = unexplained and _size(measured[j]) > AS_STRONG * _size(theirs[k]) > 0
    return Comparison(paired[0], paired[1], paired[2], instead)


def _size(residue: np.ndarray) -> float:
    return float(np.linalg.norm(np.nan_to_num(residue)))


def _together(hz: np.ndarray, residue: np.ndarray, at_hz: float) -> np.ndarray:
    """Sum (3, 3) of the residues (m, 3, 3) of modes that are close to a frequency, and so mix."""
    near = np.isfinite(hz) & (np.abs(np.log(hz / at_hz)) < TOGETHER)
    return np.sum(residue[near], axis=0)


def _difference(expected: np.ndarray, measured: np.ndarray) -> float:
    """Of residues (3, 3), relative, where both are known; NaN where nothing is."""
    known = np.isfinite(expected) & np.isfinite(measured)
    size = np.linalg.norm(expected[known])
    return float(np.linalg.norm((measured - expected)[known]) / size) if size > 0 else np.nan


def question(
    model: Model,
    state: CampaignState,
    pose: str,
    joints_deg: tuple[float, ...],
    modes: tuple[MeasuredMode, ...],
) -> Question | None:
    """What to ask the engineer before new hits of a pose are believed; None: nothing.

    `modes` are those of the new hits alone; `model` and `state` are those before the import.
    """
    if not model.labelled or not any(m.likely for m in modes):
        return None
    here, sure = compared(model, joints_deg, modes), model.low.taught
    few = len(model.labelled) < LEAST
    if few:
        here = replace(here, otherwise=np.full_like(here.otherwise, np.nan))
    if not here.contradicts(sure):
        return None
    limit = np.inf if few else _limit(model, state)  # no less than the one before
    here = replace(here, limit=limit)
    if not here.contradicts(sure):
        return None
    others = {m.pose: m.joints_deg for m in state.used}
    others |= {name: state.proposals[name].joints_deg for name in state.open}
    others.pop(pose, None)
    same = [modes] * len(others)
    found = _compared(model, [*others.values()], same, limit) if others else []
    elsewhere = zip(others, found, strict=True)
    fitting = {name: c.log_density for name, c in elsewhere if c.fits}
    fits = max(fitting, key=lambda name: fitting[name]) if fitting else ""
    return _asked(pose, here, fits)


def repeated(
    model: Model, pose: str, joints_deg: tuple[float, ...], modes: tuple[MeasuredMode, ...]
) -> Question | None:
    """The same, of hits that are those of another measured pose: no chain makes them so."""
    if not model.labelled or not any(m.likely for m in modes):
        return None
    measured = _measured_elsewhere(model, pose, joints_deg, modes)
    here = compared(model, joints_deg, modes)
    return _asked(pose, here, measured, repeated=True) if measured else None


def _measured_elsewhere(
    model: Model, pose: str, joints_deg: tuple[float, ...], modes: tuple[MeasuredMode, ...]
) -> str:
    """The measured pose whose hits these repeat, though the simulation sets both poses apart.

    Poses that it holds to be alike, such as those that differ in a turn of the whole robot, may
    well be. Without a simulation nothing tells.
    """
    q = model.cell.robot.joints.internal([joints_deg])
    there = model.low.frequencies(q).frequency_hz[0]
    new = [to_mode(mode) for mode in modes if mode.likely]
    for known in model.labelled:
        off = np.abs(np.log(there / model.low.frequencies(known.q[None]).frequency_hz[0]))
        found = [mode is not None for mode in known.modes]
        apart = bool(np.any(off[: len(found)][found] > FAR))  # False where it is not known
        if known.pose != pose and apart and _repeats(known.modes, new):
            return known.pose
    return ""


def _repeats(known: Sequence[Mode | None], new: Sequence[Mode]) -> bool:
    """Whether each known mode is found again, where it was and as it answered."""
    differences = []
    for mode in known:
        if mode is None:
            continue
        off = [abs(float(np.log(one.frequency_hz / mode.frequency_hz))) for one in new]
        again = new[int(np.argmin(off))]
        sd = np.hypot(
            mode.frequency_sd_hz / mode.frequency_hz, again.frequency_sd_hz / again.frequency_hz
        )
        if min(off) > SAME_POSE + SAME_POSE_SD * sd:
            return False
        differences.append(_difference(mode.residue, again.residue))
    told = [difference for difference in differences if np.isfinite(difference)]
    alike = not told or float(np.mean(told)) < ANSWERS_OTHERWISE
    return len(differences) >= LEAST_MODES and alike


def compared(
    model: Model, joints_deg: tuple[float, ...], modes: tuple[MeasuredMode, ...]
) -> Comparison:
    """Modes measured at a pose against what the model expects there."""
    return _compared(model, [joints_deg], [modes])[0]


def _limit(model: Model, state: CampaignState) -> float:
    """How far residues may be off, by how far they are at the measured poses."""
    used = [m for m in state.used if any(mode.likely for mode in m.modes)]
    there = _compared(model, [m.joints_deg for m in used], [m.modes for m in used])
    known = [one.difference for one in there if np.isfinite(one.difference)]
    return max(ANSWERS_OTHERWISE, MORE_THAN_THERE * float(np.median(known)) if known else 0.0)


def _compared(
    model: Model,
    poses_deg: Sequence[tuple[float, ...]],
    modes: Sequence[tuple[MeasuredMode, ...]],
    limit: float = ANSWERS_OTHERWISE,
) -> list[Comparison]:
    """What is expected at each of at least one pose, against the modes that are said to be its."""
    q = model.cell.robot.joints.internal(poses_deg)
    (hz, sd), simulated = model.frequencies(q), model.low.simulate(q, ABOVE)
    known = model.low.simulation is not None
    found = []
    for i, own in enumerate(modes):
        theirs = simulated[i : i + 1] if known else None
        one = compare(hz[i], sd[i], own, theirs)
        found.append(replace(one, limit=limit))
    return found


def _asked(pose: str, here: Comparison, fits: str, repeated: bool = False) -> Question:
    near = np.where(np.abs(here.off) < NOT_FOUND, here.in_sd, np.nan)
    k = int(np.nanargmax(near if np.isfinite(near).any() else here.in_sd))
    off_sd, percent = float(here.in_sd[k]), float(100 * np.expm1(here.off[k]))
    instead = f"they fit {fits} far better" if fits else "they fit no other known pose either"
    what = f"lie {off_sd:.0f} sd ({percent:+.1f} %, mode {k + 1}) from what is expected at {pose}"
    if repeated:
        what, instead = f"repeat the modes measured at {fits}", f"others are expected at {pose}"
    elif not here.far.any():
        mean = 100 * here.difference
        what = (
            f"have the frequencies expected at {pose}, but other mode shapes at the tool (their "
            f"residues differ by {mean:.0f} %)"
        )
    text = f"These hits {what}; {instead}. Is the robot at {pose}?"
    return Question(text, k + 1, off_sd, percent, fits)
