"""Every model of `[surrogate] model` is held to one contract.

`pytest -m slow tests/surrogate/test_frequency_models.py` adds MFDGP.
"""

from functools import cache

import numpy as np
import pytest

from planner.design.frequency_posterior import FrequencyOutputs, Poses, Target
from planner.design.propose import ACQUISITIONS
from planner.errors import InputError
from planner.surrogate.average import Average
from planner.surrogate.frequency_models import MODELS, check_choice
from planner.surrogate.modal_surrogate import (
    ModalObservations,
    Surrogate,
    fit_primary,
    fit_surrogate,
)
from tests.support.surrogates import observed, simulated, true_hz

POSES, MODES = 14, 2
OFF = 1.03  # times what is simulated, and bent
WITHOUT_GP = "none"
every = pytest.mark.parametrize(
    "name",
    [pytest.param(m, marks=pytest.mark.slow if m == "mfdgp" else ()) for m in MODELS],
)


def seen(n: int = POSES, missing: bool = False) -> ModalObservations:
    data = observed(n, 3, OFF, MODES)
    if missing:  # one of each, so that what was compiled for all serves again
        data.frequency_hz[0, 0] = data.frequency_hz[1, 1] = np.nan
    return data


def twice(n: int) -> ModalObservations:
    """Every pose again; mode 2 is everywhere the same, and simulated so."""
    data = seen(n)
    data.frequency_hz[:, 1] = data.simulated.frequency_hz[:, 1] = 30.0
    return data[np.tile(np.arange(n), 2)]


@cache
def fitted(name: str) -> Average:
    return fit(name, seen())


def fit(name: str, data: ModalObservations, kernel: str | None = None) -> Average:
    elsewhere = np.random.default_rng(0).random((60, 2))
    hz = simulated(elsewhere, MODES).frequency_hz
    return fit_primary(data, model=name, kernel=kernel, elsewhere=(elsewhere, hz))


def predicted(model: Average, x: np.ndarray, nugget: bool) -> tuple[np.ndarray, np.ndarray]:
    return model.predict(x, np.log(simulated(x, MODES).frequency_hz), nugget)


@every
def test_measured_poses_are_met_and_new_visits_lie_in_the_intervals(name: str) -> None:
    new = np.vstack([seen().x, np.random.default_rng(9).random((60, 2))])
    mean, sd = predicted(fitted(name), new, nugget=True)
    off = np.abs(mean - np.log(true_hz(new, OFF, MODES)))
    assert np.mean(off <= 1.96 * np.hypot(sd, 1e-3)) >= 0.85
    assert np.median(off[:POSES]) < (0.05 if name == WITHOUT_GP else 0.004)


@every
def test_far_from_all_poses_it_is_less_sure(name: str) -> None:
    data = seen()
    near, far = (predicted(fitted(name), x, False)[1] for x in (data.x, np.array([[2.5, 2.5]])))
    assert np.all(far >= (1 - 1e-9) * np.median(near, axis=0))  # equal where nothing is learned
    if name != WITHOUT_GP:
        assert np.all(far > 2 * np.median(near, axis=0))


@every
def test_acquisitions_ask_for_a_pose_away_from_those_measured(name: str) -> None:
    rng, data = np.random.default_rng(1), seen()
    surrogate = fit_surrogate(data, primary=fitted(name), residues=False)
    candidates = np.vstack([data.x, rng.random((40, 2))])
    poses = Poses.plain(candidates, surrogate.frequency_inputs(simulated(candidates, MODES)))
    outputs = FrequencyOutputs.of(surrogate, Target.evenly(poses))
    for acquisition in ("variance", "integrated_variance", "mutual_information"):
        gain = ACQUISITIONS[acquisition](outputs, poses)
        assert np.isfinite(gain).all()
        if name != WITHOUT_GP:
            assert int(np.argmax(gain)) >= POSES
    target, expected = outputs.workspace, np.zeros(len(candidates))
    for k in range(MODES):
        cross, own, _ = outputs.covariance(k, poses, target.poses)
        squares = cross**2 @ target.importance[:, k] / (own + outputs.noise[k])
        expected += np.mean(squares, axis=0)
    told = ACQUISITIONS["integrated_variance"](outputs, poses)
    np.testing.assert_allclose(told, expected, rtol=1e-6, atol=1e-15)


@every
def test_few_poses_missing_modes_duplicates_and_constants_are_no_reason_to_fail(name: str) -> None:
    x = np.random.default_rng(2).random((5, 2))
    for data in (seen(0), seen(1), seen(POSES + 1, missing=True), twice(POSES // 2)):
        mean, sd = predicted(fit(name, data), x, nugget=True)
        assert np.isfinite(mean).all()
        assert np.all(sd > 0)


@pytest.mark.parametrize("name", ["gp", "ar1", "default"])
def test_a_kernel_that_is_named_is_used(name: str) -> None:
    one = fit(name, seen(), "rbf")
    assert all("matern52" not in p.kernel for m in one.models for p in m.outputs)
    assert any("rbf" in p.kernel for m in one.models for p in m.outputs)


def test_without_a_simulation_the_campaign_s_weight_of_it_is_zero() -> None:
    surrogate = Surrogate(fitted("gp"), fitted("gp"), None, np.ones(MODES))
    assert not surrogate.frequency_trust.any()


@pytest.mark.parametrize(
    ("model", "kernel", "simulated", "said"),
    [
        ("krigging", None, True, r'there is no model "krigging"; choose one of default, gp, ar1'),
        ("gp", "cosine", True, r'there is no kernel "cosine"; choose one of bias'),
        ("nargp", None, False, r'"nargp" needs a simulation.* choose one of default, gp'),
    ],
)
def test_names_that_cannot_be_used_are_refused(model, kernel, simulated, said) -> None:
    with pytest.raises(InputError, match=r"campaign.toml, \[surrogate\].*" + said):
        check_choice(model, kernel, simulated, "campaign.toml, [surrogate]")
