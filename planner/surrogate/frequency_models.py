"""The models of natural frequencies that `[surrogate] model` of campaign.toml chooses from.

Each is fitted to ln f at the measured poses and to the simulation's there (and, where it has to be
learned, elsewhere), and predicts mean and sd of ln f at any pose: a `surrogate.average.Average`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from planner.errors import InputError
from planner.surrogate.ar1 import AR1, fit_ar1
from planner.surrogate.average import (
    NO_DISCREPANCY,
    PRIOR_BELIEF,
    Average,
    Priors,
    fit_hedged,
    fit_plain_or_free,
    unsimulated,
)
from planner.surrogate.kernels import KERNELS, perdikaris
from planner.surrogate.training_data import TrainingData

DEFAULT = "default"
KERNEL = "matern52"
SAMPLES, KEPT = 256, 32
FEWEST = 3  # poses from which models with likeliest hyperparameters take over from AR1


@dataclass(frozen=True, eq=False)
class FrequencyData:
    """What a model is fitted to: `data` of n poses, and the simulation at others.

    `elsewhere` are their coordinates (N, d) and the simulation's ln f (N, m). Priors and `centre`
    are as of `fit_ar1`; `belief` is the simulation's probability before these data.
    """

    data: TrainingData
    with_low: Priors
    without_low: Priors
    centre: np.ndarray
    elsewhere: tuple[np.ndarray, np.ndarray] | None = None
    belief: float = PRIOR_BELIEF
    kernel: str = KERNEL

    def ar1(self, data: TrainingData, kernel: str = "", **how: bool) -> AR1:
        """AR1 of these priors."""
        priors = self.with_low, self.without_low
        return fit_ar1(data, *priors, self.centre, SAMPLES, KEPT, kernel or self.kernel, **how)


class Predictor(Protocol):
    """What a model without covariances between poses is asked for."""

    def predict(self, x: np.ndarray, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (q, m) of the noise-free outputs at x (q, d), simulation low (q, m)."""
        ...


@dataclass(frozen=True, eq=False)
class Predicting(Average):
    """Predictions of `other`; what poses tell of each other, and the scatter, are AR1's."""

    other: Predictor

    def predict(
        self, x: np.ndarray, low: np.ndarray, nugget: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """As of `Average.predict`."""
        mean, sd = self.other.predict(x, low)
        return mean, np.hypot(sd, np.sqrt(self.nugget_variance)) if nugget else sd


def _default(seen: FrequencyData) -> Average:
    priors = seen.with_low, seen.without_low, seen.centre
    how = SAMPLES, KEPT, seen.belief, fit_plain_or_free, seen.kernel
    return fit_hedged(seen.data, *priors, *how)


def _gp(seen: FrequencyData) -> Average:
    nothing = replace(seen, centre=np.full_like(seen.centre, np.nan))
    return Average.of_one(nothing.ar1(unsimulated(seen.data)))


def _ar1(seen: FrequencyData) -> Average:
    return Average.of_one(seen.ar1(seen.data))


def _nargp(seen: FrequencyData) -> Average:
    product = perdikaris(seen.data.x.shape[1], seen.kernel)
    many = len(seen.data.x) > 1
    return Average.of_one(seen.ar1(seen.data, product, sees_low=True, thorough=many))


def _none(seen: FrequencyData) -> Average:
    exact = {"bias_sd": NO_DISCREPANCY, "slope_sd": 0.0, "amplitude": NO_DISCREPANCY}
    plain = tuple(replace(prior, **exact) for prior in seen.with_low)
    return Average.of_one(replace(seen, with_low=plain).ar1(seen.data, "bias"))


def _multitask(seen: FrequencyData) -> Average:
    from planner.surrogate.models.multitask import fit_tasks

    return _predicting(seen, fit_tasks)


def _mfdgp(seen: FrequencyData) -> Average:
    from planner.surrogate.models.mfdgp import fit_deep

    return _predicting(seen, fit_deep)


def _predicting(
    seen: FrequencyData, fit: Callable[[FrequencyData, AR1], Predictor | None]
) -> Average:
    ar1 = _ar1(seen)
    found = fit(seen, ar1.models[0]) if len(seen.data.x) >= FEWEST else None
    return ar1 if found is None else Predicting(**vars(ar1), other=found)


@dataclass(frozen=True)
class FrequencyModel:
    """How a model is fitted, and what it is, in a sentence.

    `simulation`: it makes no sense without one; `elsewhere`: it learns the simulation, too.
    """

    fit: Callable[[FrequencyData], Average]
    sentence: str
    simulation: bool = True
    elsewhere: bool = False


MODELS: dict[str, FrequencyModel] = {
    DEFAULT: FrequencyModel(
        _default, "AR1s and a GP that ignores the simulation, averaged by their evidence", False
    ),
    "gp": FrequencyModel(_gp, "a GP of the measurements alone, without the simulation", False),
    "ar1": FrequencyModel(
        _ar1, "the simulation times a factor, plus a GP (Kennedy & O'Hagan 2000)"
    ),
    "nargp": FrequencyModel(
        _nargp,
        "AR1 whose GP sees the simulation's value too, by the kernel of Perdikaris et al. 2017",
    ),
    "mfdgp": FrequencyModel(
        _mfdgp,
        "a deep GP of simulation and measurements, trained together (Cutajar et al. 2019)",
        elsewhere=True,
    ),
    "multitask": FrequencyModel(
        _multitask, "one GP of how far all modes together are off the simulation", False
    ),
    "none": FrequencyModel(_none, "the simulation as it is identified, without a GP"),
}


def check_choice(model: str, kernel: str | None, simulated: bool, where: str) -> None:
    """InputError, beginning with `where`, for names that are none, and what lacks a simulation."""
    for name, value, known in (("model", model, MODELS), ("kernel", kernel, KERNELS)):
        if value is not None and value not in known:
            choose = ", ".join(known)
            raise InputError(f'{where}: there is no {name} "{value}"; choose one of {choose}.')
    if MODELS[model].simulation and not simulated:
        without = ", ".join(name for name, one in MODELS.items() if not one.simulation)
        raise InputError(
            f'{where}: model "{model}" needs a simulation, and [fidelity] simulation is "none"; '
            f"choose one of {without}, or let it be used."
        )
