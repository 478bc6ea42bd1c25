"""Importing the public names, and using them, leaves the process as it was."""

import subprocess
import sys

import pytest

import planner

STATE = """
import json, locale, os, sys, threading, warnings

def state():
    from threadpoolctl import threadpool_info
    matplotlib = sys.modules.get("matplotlib")
    jax = sys.modules.get("jax")
    return {
        "environment": dict(os.environ),
        "filters": [str(f) for f in warnings.filters],
        "locale": locale.setlocale(locale.LC_ALL),
        "backend": matplotlib.get_backend(auto_select=False) if matplotlib else None,
        "threads": {i["filepath"]: i["num_threads"] for i in threadpool_info()},
        "jax": {k: str(v) for k, v in jax.config.values.items()} if jax else None,
        "running": [t.name for t in threading.enumerate()],
        "hook": sys.excepthook is sys.__excepthook__,
    }

def same(before, after, what):
    for key, value in before.items():
        if key == "threads":  # libraries may have been loaded meanwhile
            assert {k: after[key][k] for k in value} == value, (what, key)
        else:
            assert after[key] == value, (what, key, value, after[key])
"""

IMPORTING = """
# Their own filters of warnings are theirs.
import numpy, pinocchio, scipy.linalg, scipy.sparse.linalg, scipy.special
before = state()
import planner
assert not {"jax", "matplotlib", "rich", "msgspec", "planner.api"} & set(sys.modules)
from planner import Campaign, Dataset, Robot, Simulation, analyse, diagnose, identify
import jax
after = state()
before["jax"] = after["jax"]  # it was not there before
same(before, after, "import")
assert not jax.config.jax_enable_x64
assert jax.config.jax_numpy_rank_promotion == "allow"
assert jax.config.jax_compilation_cache_dir is None
assert not jax._src.xla_bridge.backends_are_initialized()
"""

FITTING = """
import jax, numpy as np
from planner.surrogate import gp
from planner.surrogate.training_data import Padded, Prior
before = state()
x = np.linspace(0, 1, 4)[:, None]
one = np.ones((1, 4))
padded = Padded(x, np.sin(x.T), 1e-6 * one, 0 * one, one)
theta = np.array([[0.0, -7.0, 0.0]])
prior = Prior(np.zeros(1), np.ones(1), np.ones(1), theta, 0.3 * np.ones((1, 3)))
(found,) = gp.fit(padded, prior, samples=16, kept=4)
assert found.theta.dtype == np.float64
assert abs(found.predict(x, 0 * x[:, 0])[0] - np.sin(x[:, 0])).max() < 1e-2
same(before, state(), "fit")
assert jax.numpy.ones(1).dtype == np.float32
assert (jax.numpy.ones((2, 2)) + jax.numpy.ones(2)).shape == (2, 2)
assert jax.config.jax_compilation_cache_dir is None
"""

LIVED_WITH = """
# Their own filters of warnings are theirs.
import jax, numpy, scipy.linalg, scipy.sparse.linalg, scipy.special
jax.config.update("jax_enable_x64", True)
jax.numpy.ones(1) + 1
"""


def run(*parts):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", "\n".join([STATE, *parts])],
        capture_output=True, text=True, check=False, timeout=240,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""


def test_public_names_and_a_fit_change_nothing_of_the_process():
    run(IMPORTING, FITTING)


def test_jax_that_somebody_else_has_started_is_lived_with():
    fit = FITTING.replace("assert jax.numpy.ones(1).dtype == np.float32", "")
    run(LIVED_WITH, fit, "assert jax.numpy.ones(1).dtype == np.float64")


def test_a_name_that_is_not_public_is_said_so():
    with pytest.raises(AttributeError, match="Campain"):
        _ = planner.Campain
    assert set(planner.__all__) <= set(dir(planner))
