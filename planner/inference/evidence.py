"""Log evidence by Laplace's method, tempering where no model is quite right, and Occam factors."""

from collections.abc import Sequence

import numpy as np


def temper(misfit: float, alike: float, *, shared: float = 1.0, least: float = 1.0) -> float:
    """T by which χ² is divided, so that evidence stays honest where no model is quite right.

    Args:
        misfit: χ² per real value of the best fit, 1 at the noise.
        alike: neighbouring values that err alike in what is not noise.
        shared: neighbouring values that share their noise.
        least: misfit below which noise is not believed to be overstated.

    At the noise T is misfit · shared; above, it grows with the share that is not noise.
    """
    excess = max(0.0, 1 - 1 / max(misfit, 1e-9))
    return max(misfit, least) * (shared + alike * excess)


def shared_noise(spacing_hz: float, rate_1_s: float) -> float:
    """Lines over which an exponential window smears the noise: Σ |correlation|² over all lags.

    Noise under e^(−σt) is correlated as 1 / (1 + iΔω/2σ) over Δω.
    """
    if rate_1_s <= 0:
        return 1.0
    a = 2 * np.pi * spacing_hz / (2 * rate_1_s)
    return float(np.pi / a / np.tanh(np.pi / a))


def laplace(
    chi2: float, away: np.ndarray, precision: np.ndarray, prior_sd: np.ndarray, temper: float
) -> float:
    """Log evidence at the posterior's mode: −χ²/2T − |away|²/2 − ½ ln |precision · prior|.

    `away` (p,) is the mode's distance from the prior's mean in `prior_sd` (p,); `precision`
    (p, p) that of the posterior, tempered, whose prior is normal.
    """
    volume = np.linalg.slogdet(precision * np.outer(prior_sd, prior_sd))[1]
    return float(-chi2 / (2 * temper) - away @ away / 2 - volume / 2)


def occam(away: np.ndarray, sd: np.ndarray, prior_sd: np.ndarray) -> float:
    """What parameters cost: ln of how much the data narrow each, and their distance from the prior.

    `away` (p,) in prior sds; `sd` (p,) of the posterior, one by one, and `prior_sd` (p,).
    """
    narrower = np.log(prior_sd / np.minimum(sd, prior_sd))
    return float(away @ away) / 2 + float(np.sum(narrower))


def savage_dickey(value: float, sd: float, prior_sd: float) -> float:
    """Log Bayes factor of a parameter that was found at value ± sd over its being 0.

    The ratio of prior to posterior density at 0 (Dickey 1971), both normal.
    """
    return value**2 / (2 * sd**2) + float(np.log(sd / prior_sd))


def probability(log_evidence: float, prior: float) -> float:
    """Of a hypothesis with a log Bayes factor over its opposite and a prior probability."""
    odds = log_evidence + np.log(prior / (1 - prior))
    return float(1 / (1 + np.exp(-np.clip(odds, -700.0, 700.0))))


def unexplained_shares(left: Sequence[float] | np.ndarray, independent: float) -> np.ndarray:
    """Probabilities (k,) of models from what each leaves unexplained, as a sum of squares > 0.

    What none explains is taken for as many `independent` errors of unknown variance.
    """
    ratio = np.asarray(left) / np.min(left)
    share = ratio ** (-independent / 2)
    return share / share.sum()


def bootstrapped(
    chi2: np.ndarray, log_evidence: np.ndarray, temper: float, unknown: float, count: int, seed: int
) -> np.ndarray:
    """Probabilities (k + 1,) of k models and "unknown", averaged over which data might have been.

    A Bayesian bootstrap over n sets of data (poses), as in pseudo-BMA+ (Yao et al. 2018, section
    3.4), of the sets' own χ² (k, n): what rests on one alone gets no certainty from it.
    `log_evidence` (k,) is tempered already, `unknown` that of none of the models; there are
    `count` resamples.
    """
    n = chi2.shape[1]
    shares = np.random.default_rng(seed).dirichlet(np.ones(n), count) * n
    scores = -((shares - 1) @ (chi2 - chi2[int(np.argmax(log_evidence))]).T) / (2 * temper)
    total = np.append(scores + log_evidence, np.full((count, 1), unknown), axis=1)
    total -= total.max(axis=1, keepdims=True)
    weights = np.exp(total)
    weights /= weights.sum(axis=1, keepdims=True)
    return weights.mean(axis=0)
