"""Small functions that are SciPy's too, and that the commands between two hits do without it."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.special import logsumexp, softmax

from planner.inference.log_space import log_sum, shares


def test_they_give_what_scipy_gives():
    rng = np.random.default_rng(3)
    values = rng.normal(0, 300, (4, 5, 6))
    values[1, 2], values[2, :, 3] = -np.inf, -np.inf
    for axis in (1, 2):
        assert log_sum(values, axis) == pytest.approx(logsumexp(values, axis=axis), rel=1e-14)
    finite = rng.normal(0, 300, (4, 5))
    assert shares(finite, 1) == pytest.approx(softmax(finite, axis=1), rel=1e-12)


def test_commands_between_hits_do_not_import_it():
    modules = "planner.cli.app, planner.campaign.importing, planner.campaign.build"
    code = f"import sys, {modules}, planner.report.status, planner.report.imports\n"
    code += "import planner.campaign.proposals, planner.modal.estimate_modes\n"
    code += "print([m for m in sys.modules if m.startswith(('scipy', 'jax', 'matplotlib'))])"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"


def test_status_of_what_is_kept_does_not_load_the_robot():
    code = "import sys, planner.cli.app, planner.campaign.campaign, planner.report.status\n"
    code += "print([m for m in sys.modules if m.startswith(('scipy', 'jax', 'pinocchio'))])"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"
