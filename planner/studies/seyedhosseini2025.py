"""The study of Seyed Hosseini et al. 2025: hits at 254 postures, the last 15 predicted.

A GP over the six joint angles, multi-task within each kind of parameter; FRFs put together again.
Figures are against the robot as it is, at the last postures.
"""

import tempfile
import time
from pathlib import Path

import numpy as np

from planner.frf import synthesis
from planner.progress import Tell, within
from planner.studies.models.fidelity_levels import Samples
from planner.studies.models.likelihood_gp import fit_likelihood
from planner.studies.models.multitask import fit_multitask
from planner.studies.report import Report, Table
from planner.studies.seyedhosseini2025_data import (
    DAMPING,
    FREQUENCY,
    MODES,
    RESIDUE,
    SEED,
    TABLED,
    PostureData,
    load,
)
from planner.studies.seyedhosseini2025_findings import findings
from planner.studies.seyedhosseini2025_pictures import (
    HELD_OUT,
    LINES_HZ,
    Direct,
    heatmap,
    last_postures,
    overlays,
)

SHOWN = 10, 11  # of the last 15: postures 250 and 251 of 254, as in the paper's figure 5
BAND_SAMPLES = 256  # of the modal parameters, for the band of an FRF


def study(progress: Tell, small: bool = False) -> Report:
    """Errors and coverage at the last 15 postures, correlations, and FRFs."""
    with tempfile.TemporaryDirectory() as folder:
        data = load(Path(folder), small, within(progress, 0.0, 0.8))
    progress("fitting", 0.8)
    start = time.process_time()
    mean, sd = _fit(data)
    seconds = time.process_time() - start
    progress("one GP an output, as published", 0.85)
    alone = _alone(data)
    progress("FRFs", 0.95)
    errors, correlation = _error_table(data, mean, sd), _correlations(data)
    steps, models = _steps_table(data), _models_table(data, mean, alone)
    count = len(data.q)
    frfs = {count - HELD_OUT + n + 1: _frf(data, mean[n], sd[n], n) for n in SHOWN}
    rows = tuple((f"posture {n}", *frf.r2) for n, frf in frfs.items())
    quality = Table(
        "seyedhosseini2025_frfs", "R² of |H| over 5 to 40 Hz", ("", "xx", "yy", "zz"), rows
    )
    return Report(
        "seyedhosseini2025",
        f"SIMULATED: a KR210-like robot in MuJoCo, seed {SEED}, hit at {count} postures along a "
        "trajectory of its tool, nine hits each at three levels with everyday errors; joints rub, "
        "brakes engage anew at each posture.",
        (errors, models, steps, correlation, quality),
        findings(errors, models, steps, correlation, quality, seconds, data),
        {
            "seyedhosseini2025_figure_2": heatmap(correlation),
            "seyedhosseini2025_figure_4": last_postures(data, mean, sd),
            "seyedhosseini2025_figure_5": overlays(frfs),
        },
    )


def _sizes(clean: np.ndarray) -> np.ndarray:
    """Rms (6,) of a mode's residues."""
    parts = clean[:, RESIDUE].reshape(len(clean), MODES, 6)
    return np.sqrt(np.mean(parts**2, axis=(0, 2)))


def _trained(data: PostureData, kind: slice) -> tuple[np.ndarray, np.ndarray]:
    """Postures before the last ones, x (n, 6), and a kind's parameters there, all of them found."""
    y = data.measured[:-HELD_OUT, kind]
    whole = np.isfinite(y).all(axis=1)
    return data.x[:-HELD_OUT][whole], y[whole]


def _fit(data: PostureData) -> tuple[np.ndarray, np.ndarray]:
    """Mean and sd (15, 48) at the last postures, trained with those before."""
    there = data.x[-HELD_OUT:]
    predicted = [
        fit_multitask(*_trained(data, kind)).predict(there)
        for kind in (FREQUENCY, DAMPING, RESIDUE)
    ]
    mean, sd = (np.concatenate([t[i] for t in predicted], axis=1) for i in (0, 1))
    return mean, sd


def _alone(data: PostureData) -> np.ndarray:
    """Mean (15, 12) of f and ζ by one GP each, eqs. 8 to 11: RBF, of the greatest likelihood."""
    there, columns = data.x[-HELD_OUT:], []
    for kind in (FREQUENCY, DAMPING):
        x, y = _trained(data, kind)
        columns += [
            fit_likelihood(Samples.of(x, c), "rbf", starts=1, isotropic=True).predict(there)[0]
            for c in y.T
        ]
    return np.column_stack(columns)


def _steps_table(data: PostureData) -> Table:
    """What the four steps say, and what they are worth: frequencies before and after, off by."""
    true = data.clean[:, FREQUENCY]
    off = [
        100 * np.abs(np.expm1(log_f - true))
        for log_f in (np.log(data.unchecked_hz), data.measured[:, FREQUENCY])
    ]
    checked = data.checked
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


def _models_table(data: PostureData, mean: np.ndarray, alone: np.ndarray) -> Table:
    rows = []
    for name, told in (
        ("multi-task by kind (ours)", mean),
        ("one GP an output (published)", alone),
    ):
        off = told[:, : 2 * MODES] - data.clean[-HELD_OUT:, : 2 * MODES]
        percent = 100 * np.abs(np.expm1(off))
        rows.append((name, float(percent[:, FREQUENCY].mean()), float(percent[:, DAMPING].mean())))
    return Table("seyedhosseini2025_models", "Mean error at the last 15 postures",
                 ("model", "f off by %", "ζ off by %"), tuple(rows))  # fmt: skip


def _error_table(data: PostureData, mean: np.ndarray, sd: np.ndarray) -> Table:
    """Against the truth without scatter."""
    off, spread = mean - data.clean[-HELD_OUT:], np.nanstd(data.measured[:-HELD_OUT], axis=0)
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
