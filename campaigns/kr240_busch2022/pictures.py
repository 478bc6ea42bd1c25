"""Pictures of Busch et al. 2022: figures 7 to 11, A4, and FRFs from the modes of five poses (12).

Figure 12 as published: ω by AR1, ξ by a GP with the cubic kernel, real and imaginary parts of
residues by GPs with the RBF kernel, each by itself; samples of all of them by quasi-Monte Carlo.
The sampler is Saltelli's scheme (Saltelli et al. 2010), which the paper names: one scrambled Sobol'
sequence of twice as many dimensions as there are parameters, whose halves are the matrices A and B;
as no sensitivities are wanted its mixed matrices are left out. Beside it: our fusion.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import norm, qmc

from planner.frf import synthesis
from planner.report.plot_marks import name_axes, panels
from planner.studies import drawing
from planner.studies.report import r_squared
from planner.surrogate.frf_bands import frf_moments
from planner.surrogate.kernels import kennedy_ohagan
from planner.surrogate.modal_surrogate import ModalObservations, fit_surrogate
from planner.surrogate.models.likelihood_gp import (
    Exact,
    FidelityLevel,
    Normalisation,
    Samples,
    fit_likelihood,
    fit_nargp,
)

from .data import COMPARED, FREQUENCY_MODELS, KERNELS, RESIDUES, AnalysedPoses, nearest, split

Predict = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
Fit = Callable[[Samples], Predict]
FEWEST = 3  # poses: B_3


def figure_9(x: np.ndarray, y: np.ndarray, sd: np.ndarray, fits: Mapping[str, Fit]) -> Figure:
    """Predicted over measured at the test poses, y (n,) in Hz at x (n, d); one panel a model."""
    train, test = split(x, 0)
    test = test[np.isfinite(y[test])]
    samples = Samples.of(x[train[:FEWEST]], y[train[:FEWEST]], sd[train[:FEWEST]])
    title = "Figure 9: frequency of mode 2, predicted from three poses, 95 % interval"
    figure, grid = panels((10.0, 4.6), title, 1, len(fits), sharey=True)
    ends = float(np.min(y[test])) - 0.3, float(np.max(y[test])) + 0.3
    for panel, (name, fit) in zip(grid[0], fits.items(), strict=True):
        mean, spread = fit(samples)(x[test])
        inside = np.abs(mean - y[test]) < 1.96 * np.hypot(spread, sd[test])
        panel.errorbar(
            y[test], mean, 1.96 * spread, fmt="o", ms=4, lw=1, color=drawing.COLOURS[name]
        )
        panel.plot(ends, ends, "k--", lw=0.8)
        panel.set_title(f"{name}: {inside.sum()} of {len(test)} inside", fontsize=10)
        panel.grid(True, alpha=0.25)
    name_axes(figure, grid, "measured (Hz)", "predicted (Hz)")
    return figure


FLOOR = -0.2  # of R² in bars; less is drawn cut off


def pictures(
    seven: np.ndarray, eight: np.ndarray, ten: np.ndarray, eleven: np.ndarray,
    shown: tuple[int, ...],
) -> dict[str, Figure]:  # fmt: skip
    """By file name; scores (outputs, models, 3), in 8 by count, in 11 by residue."""
    return {
        "busch2022_figure_7": _benchmark(
            seven, FREQUENCY_MODELS, "Figure 7: frequencies, 15 poses trained, 20 predicted",
            "RMSE (Hz)",
        ),
        "busch2022_figure_8": _figure_8(eight, shown),
        "busch2022_figure_10": _benchmark(
            ten, KERNELS, "Figure 10: damping ratios, 15 poses trained, 20 predicted",
            "RMSE (% of critical)",
        ),
        "busch2022_figure_11": _residues(
            eleven, 1, "Figure 11: residues, 15 poses trained, 20 predicted", "RMSE / mode's rms"
        ),
        "busch2022_figure_a4": _residues(
            eleven, 0, "Figure A4: residues, 15 poses trained, 20 predicted", "R²", FLOOR
        ),
    }  # fmt: skip


def _modes(count: int) -> list[str]:
    return [f"mode {k + 1}" for k in range(count)]


def _benchmark(scores: np.ndarray, names: tuple[str, ...], title: str, unit: str) -> Figure:
    figure, grid = panels((9.0, 6.0), title, 2)
    modes = _modes(len(scores))
    drawing.bars(grid[0, 0], modes, names, scores[..., 0], "R²", FLOOR)
    drawing.bars(grid[1, 0], modes, names, scores[..., 1], unit)
    name_axes(figure, grid)
    return figure


def _figure_8(eight: np.ndarray, shown: tuple[int, ...]) -> Figure:
    counts = np.array(shown)
    modes = eight.shape[1]
    title = "Figure 8: natural frequencies, predicted with N poses (medians over splits)"
    figure, grid = panels((3.2 * modes, 6.4), title, 2, modes)
    for k in range(modes):
        upper, lower = grid[:, k]
        drawing.curves(upper, counts, COMPARED, np.maximum(eight[:, k, :, 0], FLOOR))
        upper.axhline(0.9, color="black", ls="--", lw=0.8)
        upper.set_ylim(FLOOR - 0.03, 1.05)
        upper.set_title(f"mode {k + 1}", fontsize=10)
        drawing.curves(lower, counts, COMPARED, eight[:, k, :, 1])
        lower.set_ylim(0, 1.1 * float(np.quantile(eight[..., 1], 0.97)))
        lower.set_xticks(counts[::2] if len(counts) > 5 else counts)
    grid[0, 0].set_ylabel(f"R² (below {FLOOR:g}: drawn there)")
    grid[1, 0].set_ylabel("RMSE (Hz)")
    name_axes(figure, grid, "poses N")
    return figure


def _residues(
    eleven: np.ndarray, score: int, title: str, what: str, floor: float | None = None
) -> Figure:
    figure, grid = panels((10.0, 6.4), title, 2, 2)
    modes = _modes(eleven.shape[1])
    for panel, name, scores in zip(grid.flat, RESIDUES, eleven, strict=True):
        drawing.bars(panel, modes, KERNELS, scores[..., score], what, floor)
        panel.set_title(f"R {name.replace(' ', ', ')} part", fontsize=10)
    name_axes(figure, grid)
    return figure


TARGET_POSE = "A27"  # x 1.175 m, y 1.0 m, z 1.24 m
BAND_HZ = (5.0, 40.0)
PAIRS = ((0, 0), (0, 1), (1, 0), (1, 1))  # (response, hit): xx, xy, yx, yy
TRAINED = 5  # B_5
DRAWS, FEW_DRAWS = 10_000, 1_000  # Sobol' points; of the small version
LEAST_DAMPING = 1e-3


@dataclass(frozen=True, eq=False)
class Rebuilt:
    """R² of the four amplitudes, published, ours and with the modes measured there; what is inside.

    `inside` and `ours_inside` are shares of lines within the 95 % bands.
    """

    figure: Figure
    published_r2: list[float]
    ours_r2: list[float]
    measured_r2: list[float]
    inside: float
    ours_inside: float
    draws: int


def figure_12(seen: AnalysedPoses, small: bool = False) -> Rebuilt:
    """FRFs at a pose put together from modes that five other poses tell."""
    target = seen.poses.index(TARGET_POSE)
    seed = next(s for s in range(100) if target in split(seen.x, s)[1])
    train, there = split(seen.x, seed)[0][:TRAINED], np.array([target])
    frf = seen.frfs[target].within(BAND_HZ)
    hz, draws = frf.frequency_hz, FEW_DRAWS if small else DRAWS
    samples = np.abs(_published(seen, train, target, hz, draws))
    low, middle, high = np.quantile(samples, (0.025, 0.5, 0.975), axis=0)
    fitted = fit_surrogate(replace(seen.every[train], x=seen.x[train]))
    prediction = fitted.predict(seen.x[there], seen.every.simulated[there])
    mean, sd = (moment[0] for moment in frf_moments(prediction, hz))
    best = synthesised(seen.every, target, hz)
    measured, noise, mean, sd, best = (
        np.array([whole[pair] for pair in PAIRS])
        for whole in (frf.accelerance, np.sqrt(frf.variance), mean, sd, best)
    )
    size = np.abs(measured)
    inside = (size > low - 1.96 * noise) & (size < high + 1.96 * noise)
    # |δH|² of a complex normal error exceeds 3.0 σ² in 5 % of all cases.
    ours = np.abs(mean - measured) ** 2 < 3.0 * (sd**2 + noise**2)
    published, fused, known = (
        r_squared(np.abs(told), size, 1).tolist() for told in (middle, mean, best)
    )
    drawn, within = _draw(hz, middle, (low, high), np.abs(mean), size), float(np.mean(inside))
    return Rebuilt(drawn, published, fused, known, within, float(np.mean(ours)), draws)


def synthesised(modes: ModalObservations, pose: int, hz: np.ndarray) -> np.ndarray:
    """Accelerances (3, 3, F) in m/s²/N of a pose, put together from the modes found there."""
    known = np.isfinite(modes.frequency_hz[pose])
    poles = synthesis.pole(modes.frequency_hz[pose][known], modes.damping_ratio[pose][known])
    return synthesis.accelerance(hz, poles, modes.residue[pose][known])


def _published(
    seen: AnalysedPoses, train: np.ndarray, target: int, hz: np.ndarray, draws: int
) -> np.ndarray:
    """Accelerances (draws, 4, F) of PAIRS at the target, from samples of all modal parameters."""
    mean, sd = _moments(seen, train, target)
    normal = norm.ppf(saltelli(mean.size, draws)).reshape(draws, *mean.shape)
    drawn = mean + sd * normal  # (draws, modes, 2 + 8): ω, ξ, and both parts of four residues
    parts = drawn[..., 2:].reshape(*drawn.shape[:2], len(PAIRS), 2)
    zeta = np.clip(drawn[..., 1], LEAST_DAMPING, 0.95)
    poles = synthesis.pole(np.maximum(drawn[..., 0], 0.1), zeta)
    return synthesis.accelerance(hz, poles, parts[..., 0] + 1j * parts[..., 1])


def saltelli(dimensions: int, draws: int) -> np.ndarray:
    """Points (draws, dimensions) in (0, 1): A above B of Saltelli's scheme."""
    sobol = qmc.Sobol(2 * dimensions, scramble=True, rng=np.random.default_rng(0))
    half = -(-draws // 2)
    both = sobol.random_base2(int(np.ceil(np.log2(half))))[:half]
    points = np.vstack([both[:, :dimensions], both[:, dimensions:]])[:draws]
    return np.clip(points, 1e-9, 1 - 1e-9)


def _moments(seen: AnalysedPoses, train: np.ndarray, target: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean and sd (modes, 10) of what is predicted at the target, each by its own GP.

    Of modes that were found at all the poses trained with.
    """
    x, modes = seen.x, seen.every
    found = np.flatnonzero(np.all(np.isfinite(modes.frequency_hz[train]), axis=0))
    mean, sd = np.empty((2, len(found), 2 + 2 * len(PAIRS)))
    for row, k in enumerate(found.tolist()):
        low = modes.simulated.frequency_hz[:, k]
        frequency = Samples.of(x[train], modes.frequency_hz[train, k])
        models: list[FidelityLevel] = [
            fit_nargp(
                frequency,
                Exact(nearest(x, low)),
                Normalisation.of(low),
                isotropic=True,
                kernel=kennedy_ohagan,
            ),
            fit_likelihood(
                Samples.of(x[train], modes.damping_ratio[train, k]), "cubic", isotropic=True
            ),
        ]
        for i, j in PAIRS:
            residue = modes.residue[train, k, i, j]
            for part in (residue.real, residue.imag):
                models.append(fit_likelihood(Samples.of(x[train], part), "rbf", isotropic=True))
        told = [model.predict(x[[target]]) for model in models]
        mean[row], sd[row] = ([float(t[i][0]) for t in told] for i in (0, 1))
    return mean, sd


def _draw(
    hz: np.ndarray, middle: np.ndarray, band: tuple[np.ndarray, np.ndarray], ours: np.ndarray,
    size: np.ndarray,
) -> Figure:  # fmt: skip
    """Of PAIRS (4, F) each."""
    title = f"Figure 12: FRFs at {TARGET_POSE}, predicted from five other poses"
    figure, grid = panels((10.0, 6.4), title, 2, 2)
    for k, (i, j) in enumerate(PAIRS):
        panel = grid[i, j]
        title = f"response {'xyz'[i]}, hit {'xyz'[j]}"
        drawing.frf(panel, hz, middle[k], (band[0][k], band[1][k]), title)
        panel.plot(hz, ours[k], color="tab:green", lw=1.1, label="fused, ours")
        panel.plot(hz, size[k], "k", lw=0.9, label="measured (simulated)")
        panel.set_ylim(0, 1.6 * float(np.max(size[k])))
    name_axes(figure, grid, "frequency (Hz)", "|H| (m/s²/N)")
    return figure
