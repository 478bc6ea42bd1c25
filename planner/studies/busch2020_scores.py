"""Scores of what Busch et al. 2020's models predict beyond the training, as tables."""

from dataclasses import dataclass, field

import numpy as np

from planner.studies.busch2020_data import TRAINED_DEG, Sweep
from planner.studies.report import Table, r_squared

PAPER_R2 = {"simulation": 0.353, "GP": 0.785, "MFDGP": 0.758, "NARGP": 0.982}  # Table 2, test
PAPER_ALL = {"simulation": 0.345, "GP": 0.943, "MFDGP": 0.932, "NARGP": 0.992}  # and training
FUSED, DIAGNOSED = "fused modes", "diagnosed"
THIN = ("GP", "NARGP", FUSED)  # with every number of experiments; MFDGP and diagnosis once


@dataclass(frozen=True, eq=False)
class BeyondPrediction:
    """Amplitude (f, p) at BEYOND_DEG by name, the sd of the fused one, what diagnosis said.

    Of models as published also the amplitude at the measured angles, and sd there and beyond.
    """

    amplitude: dict[str, np.ndarray]
    sd: np.ndarray
    said: str = ""
    trained: dict[str, np.ndarray] = field(default_factory=dict)
    trained_sd: dict[str, np.ndarray] = field(default_factory=dict)
    beyond_sd: dict[str, np.ndarray] = field(default_factory=dict)


def scores(amplitude: np.ndarray, seen: Sweep) -> tuple[float, float]:
    """R² and RMSE in m/s²/N against the truth without noise."""
    rmse = np.sqrt(np.mean((amplitude - seen.truth) ** 2))
    return float(r_squared(amplitude, seen.truth)), float(rmse)


def inside(predicted: BeyondPrediction, seen: Sweep) -> float:
    """Share of the truth within 1.96 sd of the fused modes' FRF."""
    return float(np.mean(np.abs(predicted.amplitude[FUSED] - seen.truth) < 1.96 * predicted.sd))


def _everywhere(name: str, predicted: BeyondPrediction, seen: Sweep) -> float:
    """R² over measured angles (against what was measured) and those beyond (against the truth)."""
    if name not in predicted.trained:
        return float("nan")
    told = np.hstack([predicted.trained[name], predicted.amplitude[name]])
    return float(r_squared(told, np.hstack([seen.amplitude, seen.truth])))


def score_table(predicted: BeyondPrediction, seen: Sweep) -> Table:
    """R² and RMSE of every model beside the paper's."""
    nan = float("nan")
    rows = [
        (
            name,
            *scores(amplitude, seen),
            PAPER_R2.get(name, nan),
            _everywhere(name, predicted, seen),
            PAPER_ALL.get(name, nan),
        )
        for name, amplitude in predicted.amplitude.items()
    ]
    title = f"Table 2: R² and RMSE beyond {TRAINED_DEG:.0f}°, trained below; R² over both"
    columns = ("model", "R²", "RMSE m/s²/N", "R² in the paper", "R² over both", "in the paper")
    return Table("busch2020_r2", title, columns, tuple(rows))


def thin_table(predicted: dict[int, BeyondPrediction], seen: Sweep) -> Table:
    """R² with every n-th experiment (Figure 10)."""
    rows = [
        (
            f"every {step}: {len(seen.every(step).angles_deg)} experiments",
            *(scores(each.amplitude[name], seen)[0] for name in THIN),
        )
        for step, each in predicted.items()
    ]
    return Table("busch2020_experiments", "R² with fewer experiments", ("trained with", *THIN),
                 tuple(rows))  # fmt: skip


def robot_table(fused: dict[int, dict[int, tuple[BeyondPrediction, Sweep]]]) -> Table:
    """R² of fused modes on each robot, and how often its band holds."""
    rows = []
    for seed, runs in fused.items():
        r2 = [scores(each.amplitude[FUSED], seen)[0] for each, seen in runs.values()]
        held = [inside(each, seen) for each, seen in runs.values()]
        rows.append((f"robot {seed}", *r2, float(np.mean(100 * np.array(held)))))
    steps = next(iter(fused.values()))
    columns = ("", *(f"every {step}" for step in steps), "inside the 95 % band, %")
    return Table("busch2020_robots", "R² of fused modes, robot by robot, every n-th experiment",
                 columns, tuple(rows))  # fmt: skip
