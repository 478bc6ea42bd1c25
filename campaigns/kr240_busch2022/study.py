"""The study of Busch et al. 2022: kernels and fusions for modal parameters over a plane.

Figures 2 to 12, A1, A3 and A4 of the paper on the modes of hits (`data`). Each seed is another
robot with hits and a split of its own into 15 poses to train with and 20 to predict; tables have
medians over seeds.
Methods under the paper's names are as published; those called averaged, and AR1-NARGP, are ours.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import spearmanr

from planner.demo import NAME, shipped
from planner.dynamics.simulation import Simulation
from planner.progress import ProgressCallback, part_of
from planner.robot.robot import Robot
from planner.studies.claims import Bound, ClaimRule, in_order
from planner.studies.report import Paper, Report, Table, on_each, r_squared
from planner.surrogate.kernels import kennedy_ohagan, perdikaris
from planner.surrogate.models.averaged import fit_averaged
from planner.surrogate.models.likelihood_gp import (
    NARGP,
    Exact,
    LikelihoodGP,
    Normalisation,
    Samples,
    fit_likelihood,
    fit_nargp,
)

from . import data
from .data import FREQUENCY_MODELS, KERNELS, AnalysedPoses
from .maps import maps
from .pictures import TARGET_POSE, Fit, Predict, Rebuilt, figure_9, figure_12, pictures

PAPER = Paper(
    "Busch, Zaeh", 2022,
    "Multi-Fidelity Information Fusion to Model the Position-Dependent Modal Properties of "
    "Milling Robots", "Robotics 11(1), 17",
)  # fmt: skip
SEEDS = 20222, 20223, 20224
FEW = 5  # poses at most that are called few
POLYNOMIALS = "linear", "quadratic", "cubic"
HIGH = 0.9  # R², "mostly higher than 0.9"
RULES = (
    ClaimRule(
        "The first frequency falls as the tool moves away from the base (figure 4).",
        Bound("rank correlation of ω₁ with the distance", below=-0.8, full=-0.95,
              paper="falls (Fig. 4)"),
    ),
    ClaimRule(
        "The first damping ratio rises roughly with the distance.",
        Bound("rank correlation of ξ₁ with the distance", above=0, full=0.3,
              paper="roughly (Fig. 4)"),
    ),
    ClaimRule(
        "Real parts of the first direct residues are far smaller than imaginary ones.",
        Bound("rms of real over that of imaginary parts, R₁,xx and R₁,yy", below=0.5, full=0.2,
              paper="significantly (Fig. 4)"),
    ),
    ClaimRule(
        "The first frequency is nearly a linear function of the simulated one (figure 6).",
        Bound("R² of a line, ω₁", above=0.8, full=0.95, paper="nearly linear (Fig. 6)"),
    ),
    ClaimRule(
        "With 15 poses RBF, AR1 and NARGP mostly reach R² > 0.9.",
        Bound("modes and models above R² 0.9, %", above=50, full=75, paper="mostly (Fig. 7)"),
    ),
    ClaimRule(
        "Linear, quadratic and cubic kernels cannot follow the frequencies.",
        Bound("best polynomial's median R²", below=HIGH, full=0.5, paper="low (Fig. 7)"),
        Bound("best polynomial's median RMSE over RBF's", above=1, full=2,
              paper="large (Fig. 7)"),
    ),
    ClaimRule(
        "With few poses both fusions are notably better than the GP.",
        Bound("worse fusion's RMSE over RBF's, 3 to 5 poses", below=1, full=0.7,
              paper="notably better (Fig. 8)"),
    ),
    ClaimRule(
        "AR1 needs the fewest poses (median mode at R² ≥ 0.9 from then on).",
        Bound("poses that the next model needs more than AR1", above=0, full=1, paper="Fig. 8"),
    ),
    ClaimRule(
        "NARGP fluctuates, AR1 does not.",
        Bound("NARGP's mean rise of RMSE with one more pose over AR1's", above=1, full=1.5,
              paper="fluctuates (Fig. 8)"),
    ),
    ClaimRule(
        "With 3 poses the GP is over-confident about ω₂, AR1 is reliable (figure 9).",
        Bound("inside RBF's 95 % interval of ω₂, %", below=85, full=60, paper="few (Fig. 9)"),
        Bound("inside AR1's 95 % interval of ω₂, %", above=85, full=95, paper="all (Fig. 9)"),
    ),
    ClaimRule(
        "With 3 poses, hyperparameters averaged, AR1's interval is reliable.",
        Bound("inside averaged AR1's 95 % interval, all modes, %", above=85, full=90),
        ours=True,
    ),
    ClaimRule(
        "No kernel follows the damping ratios.",
        Bound("highest R² of a damping ratio by any kernel", below=0.5, full=0.3,
              paper="low (Fig. 10)"),
    ),
    ClaimRule(
        "RBF captures ξ₁ and ξ₂ best, ξ₃ and ξ₄ like every kernel.",
        Bound("next kernel's RMSE over RBF's, ξ₁ and ξ₂", above=1, full=1.1,
              paper="significantly better (Fig. 10)"),
        Bound("largest RMSE of a kernel over the least, ξ₃ and ξ₄", below=1.5, full=1.2,
              paper="similar (Fig. 10)"),
    ),
    ClaimRule(
        "A cubic kernel overfits damping less than RBF, its interval is better: it is advised.",
        Bound("RMSE that RBF gains from trained to new poses beyond cubic, %", above=0,
              paper="prevents overfitting"),
        Bound("by how much nearer to 95 % cubic's interval holds, points", above=0,
              paper="better for uncertainty"),
    ),
    ClaimRule(
        "Residues are best modelled with RBF, imaginary parts above all.",
        Bound("next kernel's RMSE over RBF's, imaginary parts", above=1, full=1.1,
              paper="RBF best (Fig. 11)"),
        Bound("next kernel's RMSE over RBF's, real parts", above=1, full=1.05),
    ),
    ClaimRule(
        "FRFs put together from five poses' modes agree with those measured (figure 12).",
        Bound("least R² of |H| of xx, xy, yx, yy", above=0.8, full=0.9, paper="agree (Fig. 12)"),
    ),
    ClaimRule(
        "The modes fused over the simulation agree better than those as published.",
        Bound("mean R² of |H| gained by fused modes", above=0, full=0.02),
        ours=True,
    ),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Output:
    """One modal parameter at all poses (35,), its sd, and the models that predict it."""

    y: np.ndarray
    sd: np.ndarray
    fits: dict[str, Fit]


@dataclass(frozen=True, eq=False)
class Run:
    """Scores (outputs, models, 4) of one robot: R², RMSE, coverage, RMSE at trained poses.

    `eight` by count of poses, `eleven` by residue.
    """

    seen: AnalysedPoses
    frequencies: list[Output]
    seven: np.ndarray
    eight: np.ndarray
    ten: np.ndarray
    eleven: np.ndarray
    twelve: Rebuilt


def study(progress: ProgressCallback, small: bool = False) -> Report:
    """All figures, and whether what the paper found in its own holds here."""
    counts, seeds = (data.FEW_COUNTS, SEEDS[:1]) if small else (data.COUNTS, SEEDS)
    runs = on_each(seeds, lambda seed, part: _run(seed, counts, small, part), progress)
    first = runs[0]
    parts = ("seven", "eight", "ten", "eleven")
    seven, eight, ten, eleven = (np.median([getattr(r, p) for r in runs], axis=0) for p in parts)
    second = first.frequencies[1]
    shown = {name: second.fits[name] for name in ("rbf", "AR1", "averaged AR1")}
    simulation = Simulation(Robot.load(shipped(NAME) / "robot" / "robot.toml"))
    return Report(
        "SIMULATED: the KR240 in MuJoCo, hit at 35 positions, nine hits each at three levels with "
        "everyday errors; every gear has its own damping, joints rub, brakes engage anew at "
        f"each visit; modes as the planner finds them. Robots: {len(runs)}.",
        _tables(seven, eight, ten, eleven, counts),
        [figures(run, counts) for run in runs],
        _notes(first),
        maps(first.seen, simulation, TARGET_POSE)
        | pictures(seven, eight, ten, eleven, counts)
        | {
            "busch2022_figure_9": figure_9(first.seen.x, second.y, second.sd, shown),
            "busch2022_figure_12": first.twelve.figure,
        },
    )


def _run(seed: int, counts: tuple[int, ...], small: bool, progress: ProgressCallback) -> Run:
    seen = data.load(seed, part_of(progress, 0.0, 0.2))
    modes, parts = seen.modes, data.split(seen.x, seed)
    progress("frequencies", 0.2)
    frequencies = [_frequency(seen, k) for k in range(modes.frequency_hz.shape[1])]
    seven = _scores(seen.x, frequencies, 15, parts)
    few = [Output(o.y, o.sd, {n: o.fits[n] for n in data.COMPARED}) for o in frequencies]
    eight = []
    for i, count in enumerate(counts):
        progress(f"frequencies with {count} poses", 0.3 + 0.4 * i / len(counts))
        eight.append(_scores(seen.x, few, count, parts))
    progress("damping ratios", 0.7)
    damping = zip(100 * modes.damping_ratio.T, 100 * modes.damping_sd.T, strict=True)
    ten = _scores(seen.x, [Output(y, sd, _kernels(KERNELS)) for y, sd in damping], 15, parts)
    eleven = []
    for i, name in enumerate(data.RESIDUES):
        progress(f"residues {name}", 0.75 + 0.2 * i / len(data.RESIDUES))
        eleven.append(_scores(seen.x, _residues(seen, name), 15, parts))
    progress("FRFs", 0.95)
    return Run(seen, frequencies, seven, np.array(eight), ten, np.array(eleven),
               figure_12(seen, small))  # fmt: skip


def _scores(
    x: np.ndarray, outputs: list[Output], count: int, parts: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """(outputs, models, 4), trained with the first `count` of the poses split off."""
    train, test = parts
    return np.array([[_score(x, o, name, train[:count], test) for name in o.fits] for o in outputs])


def _score(
    x: np.ndarray, output: Output, name: str, train: np.ndarray, test: np.ndarray
) -> tuple[float, float, float, float]:
    test = test[np.isfinite(output.y[test])]
    samples = Samples.of(x[train], output.y[train], output.sd[train])
    predict = output.fits[name](samples)
    mean, sd = predict(x[test])
    off = mean - output.y[test]
    inside = np.abs(off) < 1.96 * np.hypot(sd, output.sd[test] if name in data.OURS else 0)
    own = predict(samples.x)[0] - samples.y
    r2, rmse = float(r_squared(mean, output.y[test])), float(np.sqrt(np.mean(off**2)))
    return r2, rmse, float(inside.mean()), float(np.sqrt(np.mean(own**2)))


def _noisy(model: LikelihoodGP | NARGP) -> Predict:
    """Its mean, and the sd of what is measured there: with the fitted noise, as GPy's `predict`."""
    fitted = model.high if isinstance(model, NARGP) else model
    noise = fitted.units.scale * np.exp(fitted.theta[1])

    def predict(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        mean, sd = model.predict(x)
        return mean, np.hypot(sd, noise)

    return predict


def _kernels(names: tuple[str, ...]) -> dict[str, Fit]:
    """GPs as published: each kernel alone (eqs. 4 to 8), of the greatest likelihood."""
    return {
        name: lambda s, kernel=name: _noisy(fit_likelihood(s, kernel, isotropic=True))
        for name in names
    }


def _frequency(seen: AnalysedPoses, k: int) -> Output:
    """A mode's frequency, with the simulation's known at every pose."""
    low = seen.modes.simulated.frequency_hz[:, k]
    exact, units = Exact(data.nearest(seen.x, low)), Normalisation.of(low)
    product = perdikaris(seen.x.shape[1])
    fits = _kernels(KERNELS[1:]) | {
        "AR1": lambda s: _noisy(fit_nargp(s, exact, units, isotropic=True, kernel=kennedy_ohagan)),
        "NARGP": lambda s: _noisy(fit_nargp(s, exact, units, isotropic=True)),
        "averaged RBF": lambda s: fit_averaged(s, "rbf").predict,
        "averaged AR1": lambda s: fit_averaged(s, "rbf", exact, units.scale).predict,
        "AR1-NARGP": lambda s: fit_averaged(s, product, exact, units.scale, True).predict,
    }
    return Output(seen.modes.frequency_hz[:, k], seen.modes.frequency_sd_hz[:, k], fits)


def _residues(seen: AnalysedPoses, name: str) -> list[Output]:
    """Real or imaginary parts of a direct residue, mode by mode, over the mode's rms there."""
    direction, part = name.split()
    axis = "xyz".index(direction[0])
    value = seen.modes.residue[:, :, axis, axis]
    scale = np.sqrt(np.nanmean(np.abs(value) ** 2, axis=0))
    sd = seen.modes.residue_sd[:, :, axis, axis] / scale
    columns = (value.real if part == "real" else value.imag) / scale
    return [Output(y, s, _kernels(KERNELS)) for y, s in zip(columns.T, sd.T, strict=True)]


def figures(run: Run, counts: tuple[int, ...]) -> dict[str, float]:
    """What RULES stand on, of one robot."""
    r2 = dict(zip(FREQUENCY_MODELS, run.seven[..., 0].T, strict=True))
    rmse = dict(zip(FREQUENCY_MODELS, np.median(run.seven[..., 1], axis=0), strict=True))
    few = np.median(run.eight[[n <= FEW for n in counts]], axis=(0, 1))[:, 1]
    ready = [_first_above(run.eight[:, :, i, 0], counts) for i in range(3)]
    rough = [_roughness(run.eight[:, :, i, 1]) for i in (1, 2)]
    inside = 100 * run.eight[0, :, :, 2]  # with 3 poses (modes, models)
    damping = dict(zip(KERNELS, np.median(run.ten, axis=0), strict=True))
    over = {n: d[1] - d[3] for n, d in damping.items()}
    missed = {n: abs(95 - 100 * d) for n, d in zip(KERNELS, run.ten[..., 2].mean(0), strict=True)}
    off = run.ten[..., 1]  # (modes, kernels), RBF last
    others = off[:2, :-1].min(axis=1) / off[:2, -1]
    real, imaginary = (np.median(run.eleven[i::2, ..., 1], axis=(0, 1)) for i in (0, 1))
    low, high = run.seen.modes.simulated.frequency_hz[:, 0], run.seen.modes.frequency_hz[:, 0]
    known = np.isfinite(high)
    twelve, away = run.twelve, np.linalg.norm(run.seen.plane_m, axis=1)
    damped = run.seen.modes.damping_ratio[:, 0]
    direct = np.einsum("nii->ni", run.seen.modes.residue[:, 0])[:, :2]
    values = (
        spearmanr(away[known], high[known]).statistic,
        spearmanr(away[known], damped[known]).statistic,
        np.sqrt(np.nanmean(direct.real**2) / np.nanmean(direct.imag**2)),
        np.corrcoef(low[known], high[known])[0, 1] ** 2,
        100 * np.mean([r2[name] > HIGH for name in data.FUSIONS]),
        max(np.median(r2[name]) for name in POLYNOMIALS),
        min(rmse[name] for name in POLYNOMIALS) / rmse["rbf"],
        max(few[1], few[2]) / few[0],
        min(ready[0], ready[2]) - ready[1],
        rough[1] / max(rough[0], 1e-9),
        inside[1, 0],
        inside[1, 1],
        np.mean(inside[:, 4]),
        run.ten[..., 0].max(),
        others.min(),
        np.max(off[2:].max(axis=1) / off[2:].min(axis=1)),
        over["rbf"] - over["cubic"],
        missed["rbf"] - missed["cubic"],
        np.min(imaginary[:-1]) / imaginary[-1],
        np.min(real[:-1]) / real[-1],
        min(twelve.published_r2),
        np.mean(twelve.ours_r2) - np.mean(twelve.published_r2),
    )
    return in_order(RULES, values)


def _first_above(r2: np.ndarray, counts: tuple[int, ...]) -> int:
    """Least count from which the median mode's R² (counts, modes) stays high; one more: never."""
    below = np.flatnonzero(np.median(r2, axis=1) < HIGH)
    return (*counts, counts[-1] + 1)[int(below[-1]) + 1 if len(below) else 0]


def _roughness(rmse: np.ndarray) -> float:
    """Mean relative rise of the RMSE (counts, modes) from one count to the next."""
    return float(np.mean(np.maximum(rmse[1:] / rmse[:-1] - 1, 0.0)))


def _notes(first: Run) -> dict[str, str]:
    twelve = first.twelve
    four = ", ".join(f"{v:.2f}" for v in twelve.published_r2)
    best = ", ".join(f"{v:.2f}" for v in twelve.measured_r2)
    return {
        "highest R² of a damping ratio by any kernel": "brakes and friction make damping scatter "
        "from visit to visit",
        "next kernel's RMSE over RBF's, ξ₁ and ξ₂": "where damping scatters, a constant is "
        "hard to beat at poses not trained with",
        "least R² of |H| of xx, xy, yx, yy": f"on the first robot R² {four} for xx, xy, yx, yy "
        f"({best} with the modes measured there, which fill the band: what is missing is their "
        f"prediction from five poses); {100 * twelve.inside:.0f} % of lines within the 95 % band "
        f"of {twelve.draws} Sobol' points, {100 * twelve.ours_inside:.0f} % within that of ours",
    }


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
            for name, part in zip(data.RESIDUES, eleven, strict=True)
        ),
    )  # fmt: skip


def _figure_8_table(eight: np.ndarray, counts: tuple[int, ...]) -> Table:
    middle = np.median(eight[..., :3], axis=1)  # over modes
    columns = [f"{name} {what}" for name in data.COMPARED for what in ("R²", "RMSE", "inside")]
    rows = [(f"{n} poses", *map(float, row.ravel())) for n, row in zip(counts, middle, strict=True)]
    title = "Figure 8: R², RMSE in Hz and share inside the 95 % interval, medians over modes"
    return Table("busch2022_figure_8", title, ("", *columns), tuple(rows))
