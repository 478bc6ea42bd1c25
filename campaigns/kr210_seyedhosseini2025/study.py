"""The study of Seyed Hosseini et al. 2025: hits at 254 postures, the last 15 predicted.

A GP over the six joint angles, multi-task within each kind of parameter; FRFs put together again.
Figures are against the robot as it is, at the last postures. Each seed is another robot; tables and
pictures are the first one's.
"""

import tempfile
from pathlib import Path

import numpy as np

from planner.frf import synthesis
from planner.progress import ProgressCallback, part_of
from planner.studies.claims import Bound, ClaimRule, in_order
from planner.studies.report import Paper, Report, Table, on_each

from .data import DAMPING, FREQUENCY, MODES, RESIDUE, TABLED, PostureData, load
from .models import PAPER_MSE, Run, alone, fit, squares, why_mse
from .pictures import HELD_OUT, LINES_HZ, Direct, heatmap, last_postures, overlays

PAPER = Paper(
    "Seyed Hosseini, Hajzargarbashi, Liu", 2025,
    "Vibration Analysis of Robot Manipulators and Gaussian Process Regression for Estimating "
    "Posture-dependent FRF", "École de technologie supérieure, Montreal",
)  # fmt: skip
SEEDS = 11, 12, 13
SHOWN = 10, 11  # of the last 15: postures 250 and 251 of 254, as in the paper's figure 5
BAND_SAMPLES = 256  # of the modal parameters, for the band of an FRF
MSE = "MSE of frequencies, damping ratios and modal stiffnesses, scaled"
LARGEST = "largest error of a frequency before the check over that after"
RIGHT = 0.03  # relative error of a frequency that is the mode's own
RULES = (
    ClaimRule(
        "Joints 2 and 3 matter far more to modes 1 to 3 than joint 1.",
        Bound("largest |correlation| of joint 2 over joint 1's", above=1, full=2, paper="Fig. 2"),
        Bound("largest |correlation| of joint 3 over joint 1's", above=1, full=2),
    ),
    ClaimRule(
        "The four-step check makes modal parameters reliable.",
        Bound(LARGEST, above=1, full=2),
        Bound("mean error of a frequency before the check over that after", above=1, full=1.2),
        Bound("wrong ones among the modes that it drops, %", above=50, full=90),
        Bound("modes that it recovers from neighbours", above=0),
    ),
    ClaimRule(
        "A GP over joint angles predicts the last 15 postures' modal parameters accurately.",
        Bound(MSE, below=0.1, paper=PAPER_MSE),
        Bound("mean error of frequencies, %", below=2, full=1),
        Bound("inside their 95 % interval, %", above=75, full=90),
    ),
    ClaimRule(
        "Damping ratios are predicted less surely than frequencies.",
        Bound("damping ratios' mean error over frequencies'", above=1, full=2, paper="Fig. 4"),
    ),
    ClaimRule(
        "FRFs put together from predicted modes agree with those measured.",
        Bound("least R² of |H| at two postures", above=0.9, full=0.95, paper="agree (Fig. 5)"),
    ),
    ClaimRule(
        "GPs together within a kind predict better than one GP an output, as published.",
        Bound("frequencies' error one by one over that together", above=1, full=1.05),
        Bound("damping ratios' error one by one over that together", above=1, full=1.05),
        ours=True,
    ),
)


def study(progress: ProgressCallback, small: bool = False) -> Report:
    """Errors and coverage at the last 15 postures, correlations, and FRFs."""
    seeds = SEEDS[:1] if small else SEEDS
    runs = on_each(seeds, lambda seed, part: _run(seed, small, part), progress)
    first = runs[0]
    correlation = _correlations(first.data)
    rows = tuple((f"posture {n}", *frf.r2) for n, frf in first.frfs.items())
    quality = Table(
        "seyedhosseini2025_frfs", "R² of |H| over 5 to 40 Hz", ("", "xx", "yy", "zz"), rows
    )
    return Report(
        f"SIMULATED: a KR210-like robot in MuJoCo, hit at {len(first.data.q)} postures along a "
        "trajectory of its tool, nine hits each at three levels with everyday errors; joints rub, "
        f"brakes engage anew at each posture. Robots: {len(runs)}.",
        (_error_table(first), _models_table(first), _steps_table(first.data), correlation, quality),
        [figures(run) for run in runs],
        _notes(runs),
        {
            "seyedhosseini2025_figure_2": heatmap(correlation),
            "seyedhosseini2025_figure_4": last_postures(first.data, first.mean, first.sd),
            "seyedhosseini2025_figure_5": overlays(first.frfs),
        },
    )


def _run(seed: int, small: bool, progress: ProgressCallback) -> Run:
    with tempfile.TemporaryDirectory() as folder:
        data = load(Path(folder), seed, small, part_of(progress, 0.0, 0.8))
    progress("fitting", 0.8)
    mean, sd = fit(data)
    progress("one GP an output, as published", 0.85)
    one_by_one, count = alone(data), len(data.q)
    progress("FRFs", 0.95)
    frfs = {count - HELD_OUT + n + 1: _frf(data, mean[n], sd[n], n) for n in SHOWN}
    return Run(data, mean, sd, one_by_one, frfs)


def figures(run: Run) -> dict[str, float]:
    """What RULES stand on, of one robot."""
    f, zeta, _, _, inside, _ = np.array([r[1:] for r in _error_table(run).rows], float).T
    multi, single = (np.array(row[1:], float) for row in _models_table(run).rows)
    strength = np.abs([row[1:4] for row in _correlations(run.data).rows]).max(axis=1)
    before, after = _errors(run.data)
    checked = run.data.checked
    dropped = before[checked.doubted]
    values = (
        strength[1] / strength[0],
        strength[2] / strength[0],
        np.nanmax(before) / np.nanmax(after),
        np.nanmean(before) / np.nanmean(after),
        100 * np.mean(dropped > 100 * RIGHT) if len(dropped) else np.nan,
        checked.recovered.sum(),
        squares(run).mean(),
        f.mean(),
        inside.mean(),
        zeta.mean() / f.mean(),
        min(min(frf.r2) for frf in run.frfs.values()),
        *(single / multi),
    )
    return in_order(RULES, values)


def _notes(runs: list[Run]) -> dict[str, str]:
    data = runs[0].data
    before, after = _errors(data)
    checked = data.checked
    right = int(np.sum(before[checked.doubted] < 100 * RIGHT))
    found = int(np.sum(after[checked.recovered] < 100 * RIGHT))
    return {
        LARGEST: f"{np.nanmax(before):.2f} % before, {np.nanmax(after):.2f} % after on the first "
        f"robot (mean {np.nanmean(before):.3f} and {np.nanmean(after):.3f} %); {right} of "
        f"{checked.doubted.sum()} that it drops were right, {found} of {checked.recovered.sum()} "
        "that it recovers are",
        MSE: why_mse(runs[0]),
    }


def _errors(data: PostureData) -> tuple[np.ndarray, np.ndarray]:
    """By how much frequencies (n, modes) are off in %, before and after the check."""
    true = data.clean[:, FREQUENCY]
    before, after = (
        100 * np.abs(np.expm1(log_f - true))
        for log_f in (np.log(data.unchecked_hz), data.measured[:, FREQUENCY])
    )
    return before, after


def _sizes(clean: np.ndarray) -> np.ndarray:
    """Rms (6,) of a mode's residues."""
    parts = clean[:, RESIDUE].reshape(len(clean), MODES, 6)
    return np.sqrt(np.mean(parts**2, axis=(0, 2)))


def _steps_table(data: PostureData) -> Table:
    """What the four steps say, and what they are worth: frequencies before and after, off by."""
    off, checked = _errors(data), data.checked
    rows = [(f"share with {name}, %", 100 * share) for name, share in checked.passed.items()]
    rows += [
        ("modes found, %", 100 * float(np.mean(np.isfinite(data.unchecked_hz)))),
        ("dropped by the check", float(checked.doubted.sum())),
        ("recovered by neighbours", float(checked.recovered.sum())),
        ("f off by, before: mean %", float(np.nanmean(off[0]))),
        ("f off by, before: largest %", float(np.nanmax(off[0]))),
        ("f off by, after: mean %", float(np.nanmean(off[1]))),
        ("f off by, after: largest %", float(np.nanmax(off[1]))),
    ]
    return Table("seyedhosseini2025_steps", "The four-step check", ("", "value"), tuple(rows))


def _models_table(run: Run) -> Table:
    rows = []
    for name, told in (
        ("multi-task by kind (ours)", run.mean),
        ("one GP an output (published)", run.alone),
    ):
        off = told[:, : 2 * MODES] - run.data.clean[-HELD_OUT:, : 2 * MODES]
        percent = 100 * np.abs(np.expm1(off))
        rows.append((name, float(percent[:, FREQUENCY].mean()), float(percent[:, DAMPING].mean())))
    return Table("seyedhosseini2025_models", "Mean error at the last 15 postures",
                 ("model", "f off by %", "ζ off by %"), tuple(rows))  # fmt: skip


def _error_table(run: Run) -> Table:
    """Against the truth without scatter."""
    data, sd = run.data, run.sd
    off, spread = run.mean - data.clean[-HELD_OUT:], np.nanstd(data.measured[:-HELD_OUT], axis=0)
    rows = []
    for k in range(TABLED):
        parts = np.arange(6) + RESIDUE.start + 6 * k
        own = np.r_[k, MODES + k, parts]
        rows.append(
            (
                f"mode {k + 1}",
                float(100 * np.mean(np.abs(np.expm1(off[:, k])))),
                float(100 * np.mean(np.abs(np.expm1(off[:, MODES + k])))),
                float(100 * np.sqrt(np.mean(off[:, parts] ** 2)) / _sizes(data.clean)[k]),
                float(np.mean((off[:, own] / spread[own]) ** 2)),
                float(100 * np.mean(np.abs(off[:, k]) < 1.96 * sd[:, k])),
                float(100 * np.mean(np.abs(off[:, own]) < 1.96 * sd[:, own])),
            )
        )
    columns = ("", "f off by %", "ζ off by %", "residues off by % of size", "MSE, scaled",
               "f inside 95 %", "all inside 95 %")  # fmt: skip
    title = "The last 15 postures, against the truth"
    return Table("seyedhosseini2025_errors", title, columns, tuple(rows))


def _correlations(data: PostureData) -> Table:
    both = np.column_stack([data.q, data.measured[:, :TABLED]])
    joint = np.corrcoef(both[np.isfinite(both).all(axis=1)].T)[:6, 6:]
    rows = tuple((f"joint {j + 1}", *map(float, row)) for j, row in enumerate(joint))
    modes = (f"mode {k + 1}" for k in range(TABLED))
    return Table("seyedhosseini2025_correlation", "Correlation of joint angles with frequencies",
                 ("", *modes), rows)  # fmt: skip


def _frf(data: PostureData, mean: np.ndarray, sd: np.ndarray, which: int) -> Direct:
    """At one of the last 15 postures, from its parameters' mean and sd (48,)."""
    noise = np.random.default_rng(which).standard_normal((BAND_SAMPLES, len(mean)))
    samples = np.abs(_synthesised(mean + sd * noise))
    truth = data.truth.accelerance(data.q[-HELD_OUT + which], LINES_HZ)
    return Direct(
        np.abs(_synthesised(mean[None])[0]),
        np.quantile(samples, (0.025, 0.975), axis=0),
        np.abs(truth[np.arange(3), np.arange(3)]),
    )


def _synthesised(parameters: np.ndarray) -> np.ndarray:
    """Accelerance (s, 3, F) of parameters (s, 48)."""
    f, zeta = np.exp(parameters[:, :MODES]), np.exp(parameters[:, MODES : 2 * MODES])
    parts = parameters[:, RESIDUE].reshape(-1, MODES, 3, 2)
    return synthesis.accelerance(
        LINES_HZ, synthesis.pole(f, np.minimum(zeta, 0.95)), parts[..., 0] + 1j * parts[..., 1]
    )
