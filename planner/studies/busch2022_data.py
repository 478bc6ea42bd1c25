"""Data for Busch et al. 2022: modes in the recordings of the shipped campaign (simulated)."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from planner.campaign.cell import Cell
from planner.campaign.config import load_campaign_config
from planner.campaign.labels import label, observations
from planner.campaign.log_conversion import from_mode
from planner.campaign.state import Measurement
from planner.dataset.dataset import Dataset
from planner.demo import NAME, shipped
from planner.frf.frf import Frf
from planner.progress import Tell
from planner.surrogate.modal_surrogate import ModalObservations

KERNELS = ("bias", "linear", "quadratic", "cubic", "rbf")
FUSIONS = ("rbf", "AR1", "NARGP")
FREQUENCY_MODELS = (*KERNELS[1:], *FUSIONS[1:])
COUNTS = tuple(range(3, 16))  # training sets B_3 … B_15 of the paper
FEW_COUNTS = (3, 7, 15)  # of the small version
RESIDUES = tuple(f"{d} {part}" for d in ("xx", "yy") for part in ("real", "imaginary"))
TRAINED = 15
TRIED_DESIGNS = 200  # Latin hypercubes; that with the largest least distance is taken


@dataclass(frozen=True, eq=False)
class AnalysedPoses:
    """35 poses at x (35, d) in [0, 1], their labelled modes and their FRFs, and the simulation."""

    poses: tuple[str, ...]
    x: np.ndarray
    modes: ModalObservations
    frfs: tuple[Frf | None, ...]


def load(progress: Tell) -> AnalysedPoses:
    """Modal analysis of every recorded pose, labels by the simulation as in a campaign."""
    source = shipped(NAME)
    cell = Cell.load(
        source / "robot" / "robot.toml", load_campaign_config(source / "campaign.toml")
    )
    names, band_hz = cell.robot.joint_names, cell.config.modes.band_hz
    seen = Dataset.read(source / "recordings", names, band_hz)
    found = []
    for i, entry in enumerate(seen.entries):
        progress(f"modal analysis of pose {entry.pose}", 0.2 * i / len(seen.entries))
        modal = entry.measured.modal
        modes = tuple(from_mode(mode) for mode in (modal.modes if modal else ()))
        joints_deg = tuple(float(angle) for angle in np.rad2deg(entry.q))
        found.append(Measurement(entry.pose, joints_deg, (), modes))
    modes = observations(cell, label(cell, tuple(found)))
    x = modes.x[:, np.ptp(modes.x, axis=0) > 1e-6]
    x = (x - x.min(axis=0)) / np.ptp(x, axis=0)
    return AnalysedPoses(
        tuple(entry.pose for entry in seen.entries),
        x,
        modes,
        tuple(entry.measured.frf for entry in seen.entries),
    )


def split(x: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Strategy A: 15 poses (in a random order, whose first N are B_N) and the 20 left over.

    The poses nearest to a maximin Latin hypercube (section 2.2).
    """
    rng = np.random.default_rng(seed)
    designs = [
        qmc.LatinHypercube(x.shape[1], rng=rng).random(TRAINED) for _ in range(TRIED_DESIGNS)
    ]
    points = max(designs, key=_least_distance)
    chosen: list[int] = []
    for point in points:
        distance = np.linalg.norm(x - point, axis=1)
        distance[chosen] = np.inf
        chosen.append(int(np.argmin(distance)))
    train = rng.permutation(chosen)
    return train, np.setdiff1d(np.arange(len(x)), train)


def _least_distance(points: np.ndarray) -> float:
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    return float(apart[np.triu_indices(len(points), 1)].min())
