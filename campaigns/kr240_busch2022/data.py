"""Data for Busch et al. 2022: the KR240 of the shipped campaign, hit at its 35 positions.

Damping does not follow the stiffness (C = βK) here: every gear has its own, partly viscous, partly
a loss factor, joints rub, and brakes engage anew at each visit (`planner.studies.hits`).
"""

import csv
from collections.abc import Callable
from dataclasses import dataclass

import msgspec
import numpy as np
from scipy.spatial.distance import pdist
from scipy.stats import qmc

from planner.campaign.cell import Cell
from planner.campaign.config import load_campaign_config
from planner.campaign.labels import from_mode, label, observations
from planner.campaign.state import Measurement
from planner.demo import NAME, shipped
from planner.design import space_filling
from planner.frf.frf import Frf
from planner.progress import ProgressCallback, part_of
from planner.proof.deviation import Deviation, soft_floor
from planner.proof.hits import Hammer
from planner.proof.load import load_truth
from planner.proof.model import Truth
from planner.studies.hits import HitPoses, everyday_faults, simulate_hits
from planner.surrogate.modal_surrogate import ModalObservations

KERNELS = ("bias", "linear", "quadratic", "cubic", "rbf")
FUSIONS = ("rbf", "AR1", "NARGP")  # as published
OURS = ("averaged RBF", "averaged AR1", "AR1-NARGP")  # hyperparameters averaged
COMPARED = (*FUSIONS, *OURS)
FREQUENCY_MODELS = (*KERNELS[1:], *FUSIONS[1:], *OURS)
COUNTS = tuple(range(3, 16))  # training sets B_3 … B_15 of the paper
FEW_COUNTS = (3, 7, 15)  # of the small version
RESIDUES = tuple(f"{d} {part}" for d in ("xx", "yy") for part in ("real", "imaginary"))
TRAINED = 15
# As far as hits tell of, and all that lie there: FRFs of figure 12 hold the tails of those above
# the four modes that the paper has.
WIDE_HZ, WIDE_COUNT = (4.0, 78.0), 6
HAMMER = Hammer(oversampling=8)
FLAT = 0.01  # m: a coordinate that varies less (the height, by the readback) is none
TRIED_DESIGNS = 200  # Latin hypercubes; that with the largest least distance is taken


@dataclass(frozen=True, eq=False)
class AnalysedPoses:
    """35 poses q (35, dof) in rad, at x (35, d) in [0, 1] and `plane_m` (35, 2), with their
    labelled modes, and more of them, up to WIDE_HZ, and their FRFs."""

    poses: tuple[str, ...]
    q: np.ndarray
    x: np.ndarray
    plane_m: np.ndarray
    modes: ModalObservations
    every: ModalObservations
    frfs: tuple[Frf, ...]


def true_robot(seed: int) -> Truth:
    """The robot that is hit: other springs, inertias, a soft base, each gear's own damping."""
    base = soft_floor(2.2e7, 1.9e7, 8.2e-4)
    deviation = Deviation(seed, 0.12, 0.5, 0.04, 0.005, base, mixed=1.0)
    return load_truth(shipped(NAME) / "robot" / "robot.toml", deviation)


def places() -> dict[str, np.ndarray]:
    """Joint angles (rad) of the 35 positions of Table A1, by name, as the shipped campaign's."""
    with (shipped(NAME) / "recordings" / "recordings.csv").open(encoding="utf-8") as file:
        rows = {row["pose"]: row for row in csv.DictReader(file)}
    names = [f"joint_{k}_deg" for k in range(1, 7)]
    return {pose: np.deg2rad([float(row[n]) for n in names]) for pose, row in rows.items()}


def load(seed: int, progress: ProgressCallback) -> AnalysedPoses:
    """Hits at all poses, modal analysis, labels by the simulation as in a campaign."""
    source, truth, wanted = shipped(NAME), true_robot(seed), places()
    config = load_campaign_config(source / "campaign.toml")
    cell = Cell.load(source / "robot" / "robot.toml", config)
    band_hz, q = config.modes.band_hz, np.array(list(wanted.values()))
    struck = simulate_hits(
        truth, everyday_faults(truth, seed), q, HAMMER, band_hz, seed, part_of(progress, 0.0, 0.6)
    )
    wide = msgspec.structs.replace(config.modes, count=WIDE_COUNT, band_hz=WIDE_HZ)
    wider = Cell.load(source / "robot" / "robot.toml", msgspec.structs.replace(config, modes=wide))
    modes, every = (
        _labelled(one, tuple(wanted), struck, part_of(progress, *part))
        for one, part in ((cell, (0.6, 0.8)), (wider, (0.8, 1.0)))
    )
    x = modes.x[:, np.ptp(modes.x, axis=0) > FLAT]
    x = (x - x.min(axis=0)) / np.ptp(x, axis=0)
    plane_m = cell.robot.forward_batch(struck.q)[1][:, :2]
    return AnalysedPoses(tuple(wanted), struck.q, x, plane_m, modes, every, struck.frfs)


def _labelled(
    cell: Cell, poses: tuple[str, ...], struck: HitPoses, progress: ProgressCallback
) -> ModalObservations:
    """Of the band, and as many, as the cell's config says."""
    analysed, _ = struck.modes(cell.config.modes.band_hz, progress)
    found = []
    for pose, there, modes in zip(poses, struck.q, analysed, strict=True):
        angles = tuple(np.rad2deg(there).tolist())
        found.append(Measurement(pose, angles, (), tuple(from_mode(mode) for mode in modes)))
    return observations(cell, label(cell, tuple(found)))


def split(x: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Strategy A: 15 poses (in a random order, whose first N are B_N) and the 20 left over.

    The poses nearest to a maximin Latin hypercube (section 2.2).
    """
    rng = np.random.default_rng(seed)
    designs = [
        qmc.LatinHypercube(x.shape[1], rng=rng).random(TRAINED) for _ in range(TRIED_DESIGNS)
    ]
    points = max(designs, key=lambda design: float(pdist(design).min()))
    train = rng.permutation(space_filling.nearest(x, points, TRAINED))
    return train, np.setdiff1d(np.arange(len(x)), train)


def nearest(x: np.ndarray, values: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """What is known at x (n, d), values (n,), as a function of any of these poses (q, d)."""
    return lambda at: values[np.argmin(np.linalg.norm(x[None] - at[:, None], axis=-1), axis=1)]
