"""Cases that four random poses may leave tied, as they are hit further: linear effects, and laws.

Truths are MuJoCo models with ± 15 % springs, 4 % inertias and one of a few effects. Each pose is
hit along one axis, with much noise. FRFs of linear effects are made as such; a joint with a law is
hit in time, with LEVELS times the robot's middling peak force.
"""

from abc import ABC, abstractmethod
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.campaign.build import build
from planner.campaign.cell import Cell
from planner.campaign.config import config_from_builtins
from planner.campaign.proposals import propose
from planner.campaign.state import CampaignState, Measurement
from planner.dataset.dataset import Dataset, Visit
from planner.design.discrimination import best_hit
from planner.design.law_discrimination import best_forces, undecided
from planner.diagnosis.effects import library
from planner.diagnosis.finding import Finding
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.linear_diagnosis import Diagnosis, again, diagnose
from planner.diagnosis.screens.force_levels import screen
from planner.frf.frf import Frf
from planner.recording.records import Hit
from planner.truth.cases import PEAK_N
from planner.truth.deviation import Deviation
from planner.truth.effects import LINEAR, NONLINEAR
from planner.truth.hits import Hammer
from planner.truth.load import load_truth
from planner.truth.scene import Drawn, Scene
from planner.truth.secret import HitVisit, Secret, hit_poses
from tests.support.acquisition_cases import LINES, MODES, ROBOTS, Case

KINDS = ("transverse_compliance", "link_flexibility", "added_mass")
START = 4
FRF_NOISE = 0.15  # of the FRF's rms: with less, four hits leave hardly anything tied
HIT_NOISE = 0.1  # of a hit's response
LEVELS, REPEATS = (1.0, 2.5), 2
HITS = ""  # what robot.toml says of the hits, which never miss here

Place = tuple[str, str | None]
Next = tuple[np.ndarray, int, tuple[float, ...]]  # pose in rad, axis, peaks in N ("as usual": none)


class Campaign(ABC):
    """A case as far as it is measured; `look` says what its recordings leave tied."""

    def __init__(self, case: Case, drawn: Drawn):
        self.case, self.true = case, (drawn.effect, drawn.at)
        self.q: list[np.ndarray] = []
        self.measured: dict[str, Measurement] = {}

    def fork(self) -> "Campaign":
        """The same, to be measured further in a way of its own."""
        other = copy(self)
        for name, value in vars(self).items():
            setattr(other, name, copy(value) if isinstance(value, list | dict) else value)
        return other

    def hit(self, q: np.ndarray, axis: int, force_n: tuple[float, ...] = ()) -> None:
        self.q.append(q)
        measurement, frf = self.case.measure(q, len(self.q), (axis,))
        self.measured[measurement.pose] = measurement
        self._record(q, axis, force_n, frf)

    @abstractmethod
    def _record(self, q: np.ndarray, axis: int, force_n: tuple[float, ...], frf: Frf) -> None: ...

    @abstractmethod
    def look(self) -> None: ...

    @property
    @abstractmethod
    def frfs(self) -> tuple[Frf, ...]: ...

    @property
    @abstractmethod
    def tied(self) -> dict[tuple[Place, ...], float]:
        """Undecided candidates, most probable first."""

    @abstractmethod
    def separating(self) -> Next: ...

    def integrated_variance(self) -> Next:
        state = CampaignState(measurements=self.measured, events=len(self.q))
        by_pose = dict(zip(self.measured, self.frfs, strict=True))
        model = build(self.case.cell, state, lambda m, _: by_pose[m.pose])
        (proposal,) = propose(model, state, 1, "integrated_variance")
        return np.deg2rad(np.array(proposal.joints_deg)), "xyz".index(proposal.hits[0]), ()


class OfEffects(Campaign):
    """Linear effects: FRFs, and the candidates of a diagnosis."""

    found: Diagnosis

    def __init__(self, case: Case, drawn: Drawn):
        super().__init__(case, drawn)
        self.seen: list[Frf] = []
        self.first: Diagnosis | None = None

    def _record(self, q: np.ndarray, axis: int, force_n: tuple[float, ...], frf: Frf) -> None:
        self.seen.append(frf)

    @property
    def frfs(self) -> tuple[Frf, ...]:
        return tuple(self.seen)

    def look(self) -> None:
        simulation = self.case.cell.simulation
        assert simulation is not None
        if self.first is None:
            wanted = [e for e in library(simulation) if e.name in (*KINDS, "base_compliance")]
            self.first = diagnose(self.seen, np.array(self.q), simulation, effects=wanted)
            self.found = self.first
        else:
            self.found = again(self.first, self.seen, np.array(self.q))

    @property
    def tied(self) -> dict[tuple[Place, ...], float]:
        return {c.places: c.probability for c in self.found.undecided if c.fit is not None}

    @property
    def fits(self) -> tuple[list[Fit], list[float]]:
        """Of what is tied, and how probable each is."""
        tied = [(c.fit, c.probability) for c in self.found.undecided if c.fit is not None]
        return [f for f, _ in tied], [p for _, p in tied]

    def separating(self) -> Next:
        offered = self.case.cell.candidates.q
        best = best_hit(self.found.problem, *self.fits, offered, self.found.temper)
        return offered[best.pose], best.axis, ()


class OfLaws(Campaign):
    """A joint that is not linear: hits, and the laws that the screen for it weighs."""

    found: Finding | None

    def __init__(self, case: Case, drawn: Drawn, peak_n: float, band_hz: tuple[float, float]):
        super().__init__(case, drawn)
        self.secret, self.peak_n, self.band_hz = drawn.secret, peak_n, band_hz
        self.seen: list[Visit] = []

    def _record(self, q: np.ndarray, axis: int, force_n: tuple[float, ...], frf: Frf) -> None:
        number = len(self.q)
        rng = np.random.default_rng([self.case.seed, number, 1])
        hammer = Hammer(self.peak_n, noise=HIT_NOISE)
        usual = tuple(level * self.peak_n for level in LEVELS)
        name = "+" + "xyz"[axis]
        shots = [(name, peak) for peak in force_n or usual for _ in range(REPEATS)]
        (made,) = hit_poses(self.case.truth, self.secret, [HitVisit(q, shots)], hammer, rng)
        rate = hammer.sampling_rate_hz
        hits = tuple(
            Hit(Path("hit"), name, rate, one.force_n, one.acceleration_m_s2, simulated=True)
            for one in made
        )
        self.seen.append(Visit(f"P{number}", q, 0.0, hits))

    @property
    def recorded(self) -> Dataset:
        last = max(len(self.seen) - 1, 1)
        visits = tuple(replace(visit, order=i / last) for i, visit in enumerate(self.seen))
        return Dataset.of_visits(visits, self.band_hz)

    @property
    def frfs(self) -> tuple[Frf, ...]:
        return self.recorded.visit_frfs

    def look(self) -> None:
        simulation = self.case.cell.simulation
        assert simulation is not None
        findings = screen(self.recorded, simulation)
        self.found = next((f for f in findings if f.laws is not None), None)

    @property
    def tied(self) -> dict[tuple[Place, ...], float]:
        if self.found is None or self.found.laws is None:
            return {}
        laws = undecided(self.found.laws)
        both = zip(laws.candidates, laws.probability, strict=True)
        return {((c.law.effect, self.found.at),): share for c, share in both}

    def separating(self) -> Next:
        assert self.found is not None
        assert self.found.laws is not None
        level_n, offered = self.recorded.level_n, self.case.cell.candidates.q
        weakest, hardest = float(level_n[0]), float(level_n[-1])
        best = best_forces(undecided(self.found.laws), weakest, hardest, offered)
        return offered[best.hit.pose], best.hit.axis, best.force_n


def cell_of(robot: str, toml: Path) -> Cell:
    arm = ROBOTS[robot]
    table = {
        "robot": str(toml),
        "workspace": {"joints_deg": [list(r) for r in arm.joints_deg]},
        "modes": {"count": MODES, "band_hz": [arm.band_hz[0], 0.4 * arm.band_hz[1]]},
        "acquisition": {"candidates": 200, "hit_axes": "best"},
    }
    return Cell.load(toml, config_from_builtins(table))


def begun(seed: int, folder: Path, kinds: tuple[str, ...]) -> Campaign:
    """A case with one of the kinds concealed, its four poses hit, and what they say."""
    rng = np.random.default_rng(seed)
    robot = sorted(ROBOTS)[seed % len(ROBOTS)]
    arm, peak_n = ROBOTS[robot], PEAK_N[robot.lower().replace(" ", "")]
    toml = arm.write(folder / str(seed), 1)
    toml.write_text(toml.read_text() + HITS)
    plain = Secret(Deviation(seed, 0.15, 0.15, 0.04, 0.005))
    low, high = np.deg2rad(np.array(arm.joints_deg)).T
    poses = rng.uniform(low, high, (START, 6))
    scene = Scene(arm, load_truth(toml, plain.deviation), 1, poses, peak_n)
    drawn = {**LINEAR, **NONLINEAR}[str(rng.choice(kinds))](scene, plain, rng)
    cell = cell_of(robot, toml)
    lines = np.linspace(*cell.config.modes.band_hz, LINES)
    truth = load_truth(toml, drawn.secret.deviation)
    nothing = np.zeros((0, 6)), np.zeros((0, MODES)), lines, np.zeros((0, 3, 3, LINES))
    case = Case(truth, cell, seed, *nothing, FRF_NOISE)
    laws = drawn.effect in NONLINEAR
    out = OfLaws(case, drawn, peak_n, arm.band_hz) if laws else OfEffects(case, drawn)
    for q, axis in zip(poses, np.random.default_rng(seed).integers(0, 3, START), strict=True):
        out.hit(q, int(axis))
    out.look()
    return out
