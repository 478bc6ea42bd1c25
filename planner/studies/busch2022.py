"""The study of Busch et al. 2022: kernels and fusions for modal parameters over a plane.

Figures 7 to 12 of the paper on the modes of hits (`busch2022_data`); medians over several splits
into 15 poses to train with and 20 to predict, for one split is luck. Methods under the paper's
names are as published; those called averaged, and AR1-NARGP, are ours.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.progress import Tell
from planner.studies.busch2022_data import (
    COMPARED,
    COUNTS,
    FEW_COUNTS,
    FREQUENCY_MODELS,
    KERNELS,
    RESIDUES,
    AnalysedPoses,
    load,
    split,
)
from planner.studies.busch2022_figure_9 import figure_9
from planner.studies.busch2022_findings import findings
from planner.studies.busch2022_frf import figure_12
from planner.studies.busch2022_pictures import pictures
from planner.studies.models.ar1_nargp import fit_ar1_nargp
from planner.studies.models.fidelity_levels import Exact, Samples
from planner.studies.models.kennedy_ohagan import fit_kennedy_ohagan
from planner.studies.models.likelihood_gp import Normalisation, fit_likelihood
from planner.studies.models.nargp import fit_nargp
from planner.studies.models.recursive_ar1 import fit_recursive
from planner.studies.models.single_output_gp import fit_gp
from planner.studies.report import Report, Table, r_squared

SPLITS = 3  # of the poses, over which medians are taken
Fit = Callable[[Samples], Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]]


@dataclass(frozen=True, eq=False)
class Output:
    """One modal parameter at all poses (35,), its sd, and the models that predict it."""

    y: np.ndarray
    sd: np.ndarray
    fits: dict[str, Fit]


def study(progress: Tell, small: bool = False) -> Report:
    """All figures, and whether what the paper found in its own holds here."""
    counts, splits = (FEW_COUNTS, 1) if small else (COUNTS, SPLITS)
    seen = load(progress)
    modes = seen.modes
    progress("frequencies", 0.2)
    frequencies = [_frequency(seen, k) for k in range(modes.frequency_hz.shape[1])]
    seven = _scores(seen, frequencies, 15, splits)
    eight = []
    for i, count in enumerate(counts):
        progress(f"frequencies with {count} poses", 0.3 + 0.4 * i / len(counts))
        eight.append(_scores(seen, [_only(o, COMPARED) for o in frequencies], count, splits))
    eight = np.array(eight)
    second = frequencies[1]
    shown = {name: second.fits[name] for name in ("rbf", "AR1", "averaged AR1")}
    nine = figure_9(seen.x, second.y, second.sd, shown)
    progress("damping ratios", 0.7)
    damping = zip(100 * modes.damping_ratio.T, 100 * modes.damping_sd.T, strict=True)
    ten = _scores(seen, [Output(y, sd, _kernels(KERNELS)) for y, sd in damping], 15, splits)
    eleven = []
    for i, name in enumerate(RESIDUES):
        progress(f"residues {name}", 0.75 + 0.2 * i / len(RESIDUES))
        eleven.append(_scores(seen, _residues(seen, name), 15, splits))
    eleven = np.array(eleven)
    progress("FRFs", 0.95)
    twelve = figure_12(seen, small)
    return Report(
        "busch2022",
        "SIMULATED: the KR240 in MuJoCo, hit at 35 positions, nine hits each at three levels with "
        "everyday errors; every gear has its own damping, joints rub, brakes engage anew at "
        "each visit; modes as the planner finds them.",
        _tables(seven, eight, ten, eleven, counts),
        findings(seven, eight, ten, eleven, twelve, counts, modes),
        pictures(seven, eight, ten, eleven, counts)
        | {"busch2022_figure_9": nine, "busch2022_figure_12": twelve.figure},
    )


def _scores(seen: AnalysedPoses, outputs: list[Output], count: int, splits: int) -> np.ndarray:
    """Medians over splits (outputs, models, 3) of R², RMSE and the 95 % interval's coverage."""
    runs = np.empty((splits, len(outputs), len(outputs[0].fits), 3))
    for seed in range(splits):
        train, test = split(seen.x, seed)
        for k, output in enumerate(outputs):
            for i, fit in enumerate(output.fits.values()):
                runs[seed, k, i] = _run(seen.x, output, fit, train[:count], test)
    return np.concatenate([np.median(runs[..., :2], axis=0), runs[..., 2:].mean(axis=0)], axis=-1)


def _run(
    x: np.ndarray, output: Output, fit: Fit, train: np.ndarray, test: np.ndarray
) -> tuple[float, float, float]:
    test = test[np.isfinite(output.y[test])]
    mean, sd = fit(Samples.of(x[train], output.y[train], output.sd[train]))(x[test])
    off = mean - output.y[test]
    inside = np.abs(off) < 1.96 * np.hypot(sd, output.sd[test])
    r2 = float(r_squared(mean, output.y[test]))
    return r2, float(np.sqrt(np.mean(off**2))), float(inside.mean())


def _kernels(names: tuple[str, ...]) -> dict[str, Fit]:
    """GPs as published: each kernel alone (eqs. 4 to 8), of the greatest likelihood."""
    return {
        name: (lambda s, kernel=name: fit_likelihood(s, kernel, isotropic=True).predict)
        for name in names
    }


def _frequency(seen: AnalysedPoses, k: int) -> Output:
    """A mode's frequency, with the simulation's known at every pose."""
    low = seen.modes.simulated.frequency_hz[:, k]

    def value(x: np.ndarray) -> np.ndarray:
        return low[np.argmin(np.linalg.norm(seen.x[None] - x[:, None], axis=-1), axis=1)]

    exact, units = Exact(value), Normalisation.of(low)
    fits = _kernels(KERNELS[1:]) | {
        "AR1": lambda s: fit_kennedy_ohagan(s, exact, units, True).predict,
        "NARGP": lambda s: fit_nargp(s, exact, units, isotropic=True).predict,
        "averaged RBF": lambda s: fit_gp(s, "rbf").predict,
        "averaged AR1": lambda s: fit_recursive(s, exact, units.scale, kernel="rbf").predict,
        "AR1-NARGP": lambda s: fit_ar1_nargp(s, exact, units.scale).predict,
    }
    return Output(seen.modes.frequency_hz[:, k], seen.modes.frequency_sd_hz[:, k], fits)


def _only(output: Output, names: tuple[str, ...]) -> Output:
    return Output(output.y, output.sd, {name: output.fits[name] for name in names})


def _residues(seen: AnalysedPoses, name: str) -> list[Output]:
    """Real or imaginary parts of a direct residue, mode by mode, over the mode's rms there."""
    direction, part = name.split()
    axis = "xyz".index(direction[0])
    value = seen.modes.residue[:, :, axis, axis]
    scale = np.sqrt(np.nanmean(np.abs(value) ** 2, axis=0))
    sd = seen.modes.residue_sd[:, :, axis, axis] / scale
    columns = (value.real if part == "real" else value.imag) / scale
    return [Output(y, s, _kernels(KERNELS)) for y, s in zip(columns.T, sd.T, strict=True)]


def _table(
    name: str, title: str, scores: np.ndarray, part: int, names: tuple[str, ...] = FREQUENCY_MODELS
) -> Table:
    rows = [(f"mode {k + 1}", *map(float, row)) for k, row in enumerate(scores[..., part])]
    return Table(name, f"{title}, 15 poses trained, 20 predicted", ("", *names), tuple(rows))


def _tables(
    seven: np.ndarray, eight: np.ndarray, ten: np.ndarray, eleven: np.ndarray,
    counts: tuple[int, ...],
) -> tuple[Table, ...]:  # fmt: skip
    title = "Figure 11: RMSE of residues {}, over the mode's size"
    return (
        _table("busch2022_figure_7_r2", "Figure 7: R² of frequencies", seven, 0),
        _table("busch2022_figure_7_rmse", "Figure 7: RMSE of frequencies in Hz", seven, 1),
        _figure_8_table(eight, counts),
        _table("busch2022_figure_10_r2", "Figure 10: R² of damping ratios", ten, 0, KERNELS),
        _table("busch2022_figure_10_rmse", "Figure 10: RMSE of damping in %", ten, 1, KERNELS),
        *(
            _table(f"busch2022_figure_11_{name.replace(' ', '_')}", title.format(name), part, 1,
                   KERNELS)
            for name, part in zip(RESIDUES, eleven, strict=True)
        ),
    )  # fmt: skip


def _figure_8_table(eight: np.ndarray, counts: tuple[int, ...]) -> Table:
    middle = np.median(eight, axis=1)  # over modes: (counts, models, 3)
    columns = [f"{name} {what}" for name in COMPARED for what in ("R²", "RMSE", "inside")]
    rows = [(f"{n} poses", *map(float, row.ravel())) for n, row in zip(counts, middle, strict=True)]
    title = "Figure 8: R², RMSE in Hz and share inside the 95 % interval, medians over modes"
    return Table("busch2022_figure_8", title, ("", *columns), tuple(rows))
