"""GPs of Seyed Hosseini et al. 2025 over joint angles, and why their mean square is what it is.

As published: one GP an output. Beside it ours, multi-task within each kind of parameter.
"""

from dataclasses import dataclass

import numpy as np

from planner.surrogate.models.likelihood_gp import Samples, fit_likelihood
from planner.surrogate.models.multitask import fit_multitask

from .data import DAMPING, FREQUENCY, MODES, RESIDUE, TABLED, PostureData, stiffnesses
from .pictures import HELD_OUT, Direct

PAPER_MSE = 0.00387
COPIES, MOVED = 3, 0.01  # of each posture, by so much of angles' range and parameters' sd
KINDS = {"frequencies": slice(0, 4), "damping ratios": slice(4, 8), "stiffnesses": slice(8, 20)}


@dataclass(frozen=True, eq=False)
class Run:
    """One robot: mean and sd (15, 48) of the parameters at the last postures, together; alone."""

    data: PostureData
    mean: np.ndarray
    sd: np.ndarray
    alone: np.ndarray  # (15, 24), f and ζ, and log modal stiffness of four modes
    frfs: dict[int, Direct]


def _papers(columns: np.ndarray) -> np.ndarray:
    """The paper's parameters (n, 20) of the first four modes as KINDS has them."""
    kinds = columns[:, FREQUENCY][:, :TABLED], columns[:, DAMPING][:, :TABLED], stiffnesses(columns)
    return np.concatenate(kinds, axis=1)


def squares(run: Run) -> np.ndarray:
    """Squared errors (15, 20) of one GP an output over the variance of what it was trained with."""
    told = np.concatenate([run.alone[:, k : k + TABLED] for k in (0, MODES)], axis=1)
    off = np.concatenate([told, run.alone[:, 2 * MODES :]], axis=1)
    off -= _papers(run.data.clean[-HELD_OUT:])
    return (off / np.nanstd(_papers(run.data.measured[:-HELD_OUT]), axis=0)) ** 2


def why_mse(run: Run) -> str:
    """Which parameters make the mean square, and what the paper's figure would need."""
    data, off = run.data, squares(run)
    measured, clean = _papers(data.measured), _papers(data.clean)
    noise = ((measured - clean) / np.nanstd(measured[:-HELD_OUT], axis=0))[-HELD_OUT:]
    least = float(np.nanmean(noise**2))
    told = ", ".join(f"{np.mean(off[:, part]):.2g} of {n}" for n, part in KINDS.items())
    each = KINDS["stiffnesses"]
    softest = clean[-HELD_OUT:, each].reshape(HELD_OUT, TABLED, 3).argmin(axis=2)[..., None]
    by_axis = off[:, each].reshape(HELD_OUT, TABLED, 3)
    strong = np.mean(np.take_along_axis(by_axis, softest, axis=2))
    return (
        f"on the first robot {told} ({strong:.2g} along the axis along which a mode moves most: "
        "along others it nearly stands still somewhere, where its stiffness soars and is noise); a "
        f"single visit's own scatter is {least:.2g} on this scale, and would have to be "
        f"{np.sqrt(least / PAPER_MSE):.0f} times smaller for the paper's figure; augmented before "
        f"the split ({COPIES} copies a posture, {100 * MOVED:.0f} % off, a tenth to test with; "
        "section III.A does not say), so that tested postures have copies in the training, it is "
        f"{_augmented(data):.2g}"
    )


def _augmented(data: PostureData) -> float:
    """Scaled MSE where copies are made before postures are split, over a mode in four kinds."""
    measured = _papers(data.measured)
    whole = np.isfinite(measured).all(axis=1)
    x, y = data.x[whole], measured[whole] / np.std(measured[whole], axis=0)
    rng = np.random.default_rng(0)
    x, y = (
        np.concatenate([each, *(each + MOVED * rng.standard_normal((COPIES, *each.shape)))])
        for each in (x, y)
    )
    order = rng.permutation(len(x))
    test, train = np.split(order, [len(x) // 10])
    off = [_one_gp(x[train], y[train, k], x[test]) - y[test, k] for k in range(0, y.shape[1], 3)]
    return float(np.mean(np.square(off)))


def _trained(data: PostureData, kind: slice) -> tuple[np.ndarray, np.ndarray]:
    """Postures before the last ones, x (n, 6), and a kind's parameters there, all of them found."""
    y = data.measured[:-HELD_OUT, kind]
    whole = np.isfinite(y).all(axis=1)
    return data.x[:-HELD_OUT][whole], y[whole]


def fit(data: PostureData) -> tuple[np.ndarray, np.ndarray]:
    """Mean and sd (15, 48) at the last postures, trained with those before."""
    there = data.x[-HELD_OUT:]
    predicted = [
        fit_multitask(*_trained(data, kind)).predict(there)
        for kind in (FREQUENCY, DAMPING, RESIDUE)
    ]
    mean, sd = (np.concatenate([t[i] for t in predicted], axis=1) for i in (0, 1))
    return mean, sd


def alone(data: PostureData) -> np.ndarray:
    """Mean (15, 24) of f, ζ and log modal stiffness by one GP each, as published."""
    measured = np.c_[data.measured[:, : 2 * MODES], stiffnesses(data.measured)][:-HELD_OUT]
    found = np.isfinite(measured)
    return np.column_stack([
        _one_gp(data.x[:-HELD_OUT][some], y[some], data.x[-HELD_OUT:])
        for y, some in zip(measured.T, found.T, strict=True)
    ])  # fmt: skip


def _one_gp(x: np.ndarray, y: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Mean (q,) at `there` by eqs. 8 to 11: one length scale, of the greatest likelihood."""
    return fit_likelihood(Samples.of(x, y), "rbf", starts=1, isotropic=True).predict(there)[0]
