"""Cost of training m tasks together (Lei et al. 2023, section 5.2), by Kronecker and directly."""

import time

import numpy as np
from scipy.linalg import cho_factor

from planner.studies.models.icm import fit_icm, solve
from planner.studies.report import Table
from planner.surrogate.kernels import parse

COUNTS, FEW_COUNTS = (1, 2, 3, 4, 5, 9, 36, 72, 144), (1, 3, 9, 144)
MOST_DIRECT = 9  # tasks of which the whole matrix is factored: n·m = 1,008 rows
POSTURES = 112
PAPER_S = {1: 2.06, 2: 3.06, 3: 3.36, 4: 51.13, 5: 88.86}


def cost_table(small: bool = False) -> Table:
    """Seconds of one processor against m, of made-up tasks at 112 postures; and how exact it is."""
    rng = np.random.default_rng(0)
    x = rng.random((POSTURES, 3))
    smooth = np.column_stack([np.sin(4 * x[:, 0]), np.cos(3 * x[:, 1]), x[:, 2] * x[:, 0]])
    rows = []
    for m in FEW_COUNTS if small else COUNTS:
        y = smooth @ rng.standard_normal((3, m)) + 0.1 * rng.standard_normal((POSTURES, m))
        fit_icm(x[:8], y[:8])  # compiles
        start = time.process_time()
        fitted = fit_icm(x, y)
        seconds = time.process_time() - start
        direct, differs = float("nan"), float("nan")
        if m <= MOST_DIRECT:
            start = time.process_time()
            k = parse("rbf", 3).covariance(np, fitted.found.theta, x, x)
            k = k + 1e-9 * np.mean(np.diag(k)) * np.eye(POSTURES)
            noise = np.diag(np.exp(2 * fitted.found.log_noise))
            whole = np.kron(fitted.found.task_covariance, k) + np.kron(noise, np.eye(POSTURES))
            root = cho_factor(whole, lower=True)[0]
            direct = time.process_time() - start
            white = np.linalg.solve(np.tril(root), fitted.data.y.T.ravel())
            size = np.log(np.diag(root)).sum() + 0.5 * len(whole) * np.log(2 * np.pi)
            told = solve(fitted.data, "rbf", fitted.found).value
            differs = abs(float(-0.5 * white @ white - size) - told)
        rows.append((f"{m}", seconds, direct, differs, PAPER_S.get(m, float("nan"))))
    columns = ("m", "training, s", "one direct Cholesky, s", "log-likelihoods differ by",
               "paper: training, s")  # fmt: skip
    return Table("lei2023_cost", "Cost of m tasks in one multi-task GP", columns, tuple(rows))
