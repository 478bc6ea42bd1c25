"""The groups of Lei et al. 2023 (Figures 14 and 15): at most three parameters in a multi-task GP.

Entries of one eigenvector at the two points of one direction go together; of what is left over,
one kind of parameter of the modes of low frequency, and of those of high. Nine modes make 70
models of 144 parameters. Each is fitted as published: B free, the greatest likelihood. What the
paper says of its cross-validation ("training data of other m−1 modal parameters in the same model
is additionally used") can be read in two ways, and both are computed: nothing of a tested posture
is known, or the other parameters of the group are known there.
"""

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from planner.studies.lei2023_data import LEFT, RIGHT
from planner.studies.models.multitask import MultiTaskGP, fit_multitask
from planner.surrogate.kernels import parse

PARTS = 16  # parameters of a mode
MOST = 3  # tasks of a group
LOW_MODES = 5  # modes 1 to 5 are of low frequency
PAPER_MODELS = 70


def groups(labels: np.ndarray, reference: np.ndarray) -> list[np.ndarray]:
    """Columns of each group among the parameters of modes `labels` (k,), counted from 0.

    `reference` (k,): the entry of L that is 1, in the order 1X, 1aX, 1Y, 1aY.
    """
    found, alone = [], []
    for place, one in enumerate(reference):
        first = PARTS * place
        for point in (0, 2):  # R at 1X and 1aX, at 1Y and 1aY
            found += [first + RIGHT.start + 2 * point + part + np.array([0, 2]) for part in (0, 1)]
        pair, single = (0, 2) if one >= 2 else (1, 0)  # among the three entries of L that are left
        left = first + LEFT.start
        found += [left + 2 * pair + part + np.array([0, 2]) for part in (0, 1)]
        alone.append([first, first + 1, left + 2 * single, left + 2 * single + 1])
    kinds = np.array(alone)
    for modes in (labels < LOW_MODES, labels >= LOW_MODES):
        for kind in kinds[modes].T:
            found += [part for part in np.array_split(kind, -(-len(kind) // MOST)) if len(part)]
    return found


def predict(
    x: np.ndarray, y: np.ndarray, train: np.ndarray, wanted: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Predictions (q, m) of y (n, m) at x (n, d) where `train` (n,) is False, group by group.

    With nothing known there, and with the other parameters of the group known there.
    """
    test = ~train
    nothing, others = np.empty((2, test.sum(), y.shape[1]))
    for group in wanted:
        model = fit_multitask(x[train], y[np.ix_(train, group)], prior=False)
        nothing[:, group] = model.predict(x[test])[0]
        others[:, group] = _others_known(model, x, y[:, group], test)
    return nothing, others


def _others_known(model: MultiTaskGP, x: np.ndarray, y: np.ndarray, test: np.ndarray) -> np.ndarray:
    """Means (q, t) of each task where it is left out at the tested postures, and no other is."""
    h, n = model.hyperparameters, len(x)
    k = parse(model.tasks.kernel, x.shape[1]).covariance(np, h.theta, x, x)
    noiseless = np.kron(h.task_covariance, k)
    noisy = noiseless + np.kron(np.diag(h.noise), np.eye(n))
    scaled = ((y - model.centre) / model.scale).T.ravel()
    told = np.empty((int(test.sum()), y.shape[1]))
    for task in range(y.shape[1]):
        asked = task * n + np.flatnonzero(test)
        known = np.setdiff1d(np.arange(len(scaled)), asked)
        alpha = cho_solve(cho_factor(noisy[np.ix_(known, known)]), scaled[known])
        told[:, task] = noiseless[np.ix_(asked, known)] @ alpha
    return model.centre + model.scale * told
