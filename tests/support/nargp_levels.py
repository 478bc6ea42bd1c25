"""The cheap level of NARGP, fitted to samples as emukit does."""

from planner.surrogate.models.likelihood_gp import STARTS, LikelihoodGP, Samples, fit_likelihood


def fit_low(samples: Samples, noise: float = 1e-2, starts: int = STARTS) -> LikelihoodGP:
    """The lowest level: an RBF GP of the cheap samples.

    Its noise is held, as in emukit, whose intermediate levels have a variance of 1e-4.
    """
    return fit_likelihood(samples, "rbf", noise, starts=starts)
