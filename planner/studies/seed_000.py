"""Seed 000 again (Busch et al. 2022): kernels and fusions for modal parameters over a plane.

Figures 7, 8, 10, 11 and 12 of the paper on the shipped campaign; medians over several splits into
15 poses to train with and 20 to tell, for one split is luck.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.fusion.levels import Exact, Samples
from planner.fusion.nargp import fit_nargp
from planner.fusion.recursive import fit_recursive
from planner.fusion.single import fit_gp
from planner.studies.recorded import Recorded, load, split
from planner.studies.report import Finding, Progress, Report, Table
from planner.studies.seed_000_frf import Rebuilt, figure_12
from planner.studies.seed_000_pictures import pictures

KERNELS = ("bias", "linear", "quadratic", "cubic", "rbf")
FUSIONS = ("rbf", "AR1", "NARGP")
SPLITS = 5
COUNTS = tuple(range(3, 16))  # B_3 … B_15
RESIDUES = tuple(f"{d} {part}" for d in ("xx", "yy") for part in ("real", "imaginary"))
Fit = Callable[[Samples], Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]]


@dataclass(frozen=True, eq=False)
class Output:
    """One modal parameter at all poses (35,), its sd, and the models that are to tell it."""

    y: np.ndarray
    sd: np.ndarray
    fits: dict[str, Fit]


def study(progress: Progress) -> Report:
    """All figures, and whether what the paper found in its own holds here."""
    seen = load(progress)
    modes = seen.modes
    progress("frequencies", 0.2)
    frequencies = [_frequency(seen, k) for k in range(modes.frequency_hz.shape[1])]
    seven = _scores(seen, frequencies, 15)
    eight = []
    for i, count in enumerate(COUNTS):
        progress(f"frequencies with {count} poses", 0.3 + 0.4 * i / len(COUNTS))
        eight.append(_scores(seen, [_only(o, FUSIONS) for o in frequencies], count))
    eight = np.array(eight)
    progress("damping ratios", 0.7)
    damping = zip(100 * modes.damping_ratio.T, 100 * modes.damping_sd.T, strict=True)
    ten = _scores(seen, [Output(y, sd, _kernels(KERNELS)) for y, sd in damping], 15)
    eleven = []
    for i, name in enumerate(RESIDUES):
        progress(f"residues {name}", 0.75 + 0.2 * i / len(RESIDUES))
        eleven.append(_scores(seen, _residues(seen, name), 15))
    eleven = np.array(eleven)
    progress("FRFs", 0.95)
    twelve = figure_12(seen)
    return Report(
        "seed-000",
        "SIMULATED: the shipped campaign kr240_plane, 35 poses recorded in MuJoCo with a hammer's "
        "noise, modes as the planner finds them.",
        (
            _table("seed_000_figure_7_r2", "Figure 7: R² of frequencies", seven, 0),
            _table("seed_000_figure_7_rmse", "Figure 7: RMSE of frequencies in Hz", seven, 1),
            _figure_8_table(eight),
            _table("seed_000_figure_10_r2", "Figure 10: R² of damping ratios", ten, 0, KERNELS),
            _table("seed_000_figure_10_rmse", "Figure 10: RMSE of damping ratios in %", ten, 1,
                   KERNELS),
            *(
                _table(f"seed_000_figure_11_{name.replace(' ', '_')}",
                       f"Figure 11: RMSE of residues {name}, over the mode's size", part, 1,
                       KERNELS)
                for name, part in zip(RESIDUES, eleven, strict=True)
            ),
        ),
        (
            *_about_frequencies(seven, eight),
            *_about_the_rest(ten, eleven),
            _about_frfs(twelve),
        ),
        pictures(seven, eight, ten, eleven) | {"seed_000_figure_12": twelve.figure},
    )  # fmt: skip


NAMES_7 = (*KERNELS[1:], *FUSIONS[1:])


def _scores(seen: Recorded, outputs: list[Output], count: int) -> np.ndarray:
    """Medians over splits (outputs, models, 3) of R², RMSE and the 95 % interval's coverage."""
    runs = np.empty((SPLITS, len(outputs), len(outputs[0].fits), 3))
    for seed in range(SPLITS):
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
    r2 = 1 - np.mean(off**2) / np.var(output.y[test])
    return float(r2), float(np.sqrt(np.mean(off**2))), float(inside.mean())


def _kernels(names: tuple[str, ...]) -> dict[str, Fit]:
    return {name: (lambda s, kernel=name: fit_gp(s, kernel).predict) for name in names}


def _frequency(seen: Recorded, k: int) -> Output:
    """A mode's frequency, with the simulation's known at every pose."""
    low = seen.modes.simulated.frequency_hz[:, k]

    def value(x: np.ndarray) -> np.ndarray:
        return low[np.argmin(np.linalg.norm(seen.x[None] - x[:, None], axis=-1), axis=1)]

    def fused(fit: Callable) -> Fit:
        return lambda s: fit(s, Exact(value), float(np.std(low)), kernel="rbf").predict

    def bent(s: Samples) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        return fit_nargp(s, Exact(value), float(np.std(low))).predict

    fits = _kernels(KERNELS[1:]) | {"AR1": fused(fit_recursive), "NARGP": bent}
    return Output(seen.modes.frequency_hz[:, k], seen.modes.frequency_sd_hz[:, k], fits)


def _only(output: Output, names: tuple[str, ...]) -> Output:
    return Output(output.y, output.sd, {name: output.fits[name] for name in names})


def _residues(seen: Recorded, name: str) -> list[Output]:
    """Real or imaginary parts of a direct residue, mode by mode, over the mode's rms there."""
    direction, part = name.split()
    axis = "xyz".index(direction[0])
    value = seen.modes.residue[:, :, axis, axis]
    scale = np.sqrt(np.nanmean(np.abs(value) ** 2, axis=0))
    sd = seen.modes.residue_sd[:, :, axis, axis] / scale
    columns = (value.real if part == "real" else value.imag) / scale
    return [Output(y, s, _kernels(KERNELS)) for y, s in zip(columns.T, sd.T, strict=True)]


def _table(
    name: str, title: str, scores: np.ndarray, part: int, names: tuple[str, ...] = NAMES_7
) -> Table:
    rows = [(f"mode {k + 1}", *map(float, row)) for k, row in enumerate(scores[..., part])]
    return Table(name, f"{title}, 15 poses trained, 20 told", ("", *names), tuple(rows))


def _figure_8_table(eight: np.ndarray) -> Table:
    middle = np.median(eight, axis=1)  # over modes: (counts, models, 3)
    columns = [f"{name} {what}" for name in FUSIONS for what in ("R²", "RMSE", "inside")]
    rows = [(f"{n} poses", *map(float, row.ravel())) for n, row in zip(COUNTS, middle, strict=True)]
    title = "Figure 8: R², RMSE in Hz and share inside the 95 % interval, medians over modes"
    return Table("seed_000_figure_8", title, ("", *columns), tuple(rows))


def _about_frequencies(seven: np.ndarray, eight: np.ndarray) -> tuple[Finding, ...]:
    r2 = dict(zip(NAMES_7, seven[..., 0].T, strict=True))
    rmse = dict(zip(NAMES_7, np.median(seven[..., 1], axis=0), strict=True))
    high = np.mean([r2[name] > 0.9 for name in FUSIONS])
    plain = min(rmse[name] for name in ("linear", "quadratic", "cubic"))
    few = np.median(eight[:3], axis=(0, 1))  # 3 to 5 poses: (models, 3)
    ready = [_first_above(eight[:, :, i, 0]) for i in range(3)]
    rough = [_roughness(eight[:, :, i, 1]) for i in (1, 2)]
    return (
        Finding(
            "With 15 poses RBF, AR1 and NARGP mostly reach R² > 0.9.",
            f"in {100 * high:.0f} % of modes and models; least "
            + ", ".join(f"{n} {r2[n].min():.3f}" for n in FUSIONS),
            bool(high > 0.5),
        ),
        Finding(
            "Linear, quadratic and cubic kernels cannot follow the frequencies.",
            f"median RMSE at best {plain:.2f} Hz, RBF {rmse['rbf']:.2f} Hz",
            plain > 2 * rmse["rbf"],
        ),
        Finding(
            "With few poses both fusions are notably better than the GP.",
            f"RMSE with 3 to 5 poses: RBF {few[0, 1]:.2f}, AR1 {few[1, 1]:.2f}, "
            f"NARGP {few[2, 1]:.2f} Hz",
            max(few[1, 1], few[2, 1]) < 0.7 * few[0, 1],
        ),
        Finding(
            "AR1 needs the fewest poses (median mode at R² ≥ 0.9 from then on).",
            f"RBF {ready[0]}, AR1 {ready[1]}, NARGP {ready[2]} poses",
            ready[1] <= min(ready),
        ),
        Finding(
            "NARGP fluctuates, AR1 does not.",
            f"RMSE rises with one more pose by {100 * rough[0]:.0f} % (AR1) and "
            f"{100 * rough[1]:.0f} % (NARGP) on average",
            rough[1] > 1.5 * rough[0],
        ),
        Finding(
            "With 3 poses the GP is over-confident, AR1's interval is reliable.",
            f"inside the 95 % interval: RBF {100 * np.mean(eight[0, :, 0, 2]):.0f} %, "
            f"AR1 {100 * np.mean(eight[0, :, 1, 2]):.0f} %",
            bool(np.mean(eight[0, :, 0, 2]) < 0.8 < np.mean(eight[0, :, 1, 2])),
        ),
    )


def _first_above(r2: np.ndarray) -> int:
    """Least count from which the median mode's R² (counts, modes) stays at 0.9."""
    good = np.median(r2, axis=1) >= 0.9
    below = np.flatnonzero(~good)
    return COUNTS[min(int(below[-1]) + 1, len(COUNTS) - 1)] if len(below) else COUNTS[0]


def _roughness(rmse: np.ndarray) -> float:
    """Mean relative rise of the RMSE (counts, modes) from one count to the next."""
    return float(np.mean(np.maximum(rmse[1:] / rmse[:-1] - 1, 0.0)))


def _about_the_rest(ten: np.ndarray, eleven: np.ndarray) -> tuple[Finding, ...]:
    damping = dict(zip(KERNELS, ten[..., 0].T, strict=True))
    rmse = dict(zip(KERNELS, np.median(ten[..., 1], axis=0), strict=True))
    imaginary = np.median(eleven[1::2, ..., 1], axis=(0, 1))
    real = np.median(eleven[::2, ..., 1], axis=(0, 1))
    return (
        Finding(
            "No kernel follows the damping ratios.",
            "R² of RBF " + ", ".join(f"{v:.2f}" for v in damping["rbf"]) + " for modes 1 to 4: "
            "this robot's damping is C = βK with scatter, so it follows the pose",
            float(np.max(damping["rbf"])) < 0.5,
        ),
        Finding(
            "RBF is best for damping, yet a cubic kernel is advised (it overfits less).",
            f"median RMSE: bias {rmse['bias']:.3f}, cubic {rmse['cubic']:.3f}, "
            f"RBF {rmse['rbf']:.3f} %",
            rmse["cubic"] <= rmse["rbf"],
        ),
        Finding(
            "Residues are best modelled with RBF, imaginary parts above all.",
            f"median RMSE of imaginary parts: RBF {imaginary[-1]:.3f}, next "
            f"{np.min(imaginary[:-1]):.3f}; of real parts: RBF {real[-1]:.4f}, next "
            f"{np.min(real[:-1]):.4f}",
            bool(imaginary[-1] < np.min(imaginary[:-1])),
        ),
    )


def _about_frfs(twelve: Rebuilt) -> Finding:
    told, best = (", ".join(f"{v:.3f}" for v in r2) for r2 in (twelve.told_r2, twelve.measured_r2))
    return Finding(
        "FRFs put together from five poses' modes agree with those measured (figure 12).",
        f"R² of |H| {told} for xx, xy, yx, yy, {best} with the four modes measured there (modes "
        f"above them are missing); {100 * twelve.inside:.0f} % within the 95 % band",
        min(twelve.told_r2) > 0.9,
    )
