"""The models of natural frequencies that `[surrogate] model` of campaign.toml chooses from.

Each is fitted to ln f at the measured poses and to the simulation's there (and, where it has to be
learned, elsewhere), and predicts mean and sd of ln f at any pose: a `surrogate.average.Average`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from planner.errors import InputError
from planner.surrogate.ar1 import AR1, FusionData, fit_ar1
from planner.surrogate.average import (
    NO_DISCREPANCY,
    PRIOR_BELIEF,
    Average,
    fit_hedged,
    fit_plain_or_free,
)
from planner.surrogate.kernels import KERNELS, perdikaris

DEFAULT = "default"
KERNEL = "matern52"
SAMPLES, KEPT = 256, 32
FEWEST = 3  # poses from which models with likeliest hyperparameters take over from AR1


@dataclass(frozen=True, eq=False)
class FrequencyData(FusionData):
    """What a model is fitted to: values of n poses, and the simulation at others.

    `elsewhere` are their coordinates (N, d) and the simulation's ln f (N, m); `belief` is the
    simulation's probability before these data.
    """

    elsewhere: tuple[np.ndarray, np.ndarray] | None = None
    belief: float = PRIOR_BELIEF
    kernel: str = KERNEL


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
    return fit_hedged(seen, SAMPLES, KEPT, seen.belief, fit_plain_or_free, seen.kernel)


def _ar1(seen: FrequencyData, **how: bool) -> Average:
    model = fit_ar1(seen, SAMPLES, KEPT, seen.kernel, **how)
    return Average((model,), np.ones((1, len(model.outputs))), model.log_evidence)


def _nargp(seen: FrequencyData) -> Average:
    poses, dimensions = seen.values.x.shape
    seen = replace(seen, kernel=perdikaris(dimensions, seen.kernel))
    return _ar1(seen, thorough=poses > 1, sees_low=True)


def _none(seen: FrequencyData) -> Average:
    exact = {"bias_sd": NO_DISCREPANCY, "slope_sd": 0.0, "amplitude": NO_DISCREPANCY}
    plain = tuple(replace(prior, **exact) for prior in seen.with_low)
    return _ar1(replace(seen, with_low=plain, kernel="bias"))


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
    found = fit(seen, ar1.models[0]) if len(seen.values.x) >= FEWEST else None
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
    "gp": FrequencyModel(
        lambda seen: _ar1(seen.alone),
        "a GP of the measurements alone, without the simulation",
        False,
    ),
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
