"""The four-step check: what it keeps, drops, and finds again."""

from dataclasses import replace

import numpy as np
import pytest

from planner.frf import synthesis
from planner.frf.frf import Frf
from planner.modal.modes import Mode
from tests.support.studied import part

check = part("seyedhosseini2025", "four_steps").check
HZ = np.arange(4.0, 40.0, 0.25)


def mode(f, probability=1.0):
    residue = 1e-3j * np.diag([1.0, 0.7, 0.4]) * -1
    sd = np.full((3, 3), 1e-6)
    return Mode(f, 0.01, 0.02, 0.001, residue, sd, np.array([1.0, 0, 0]), probability)


def frf(*modes):
    poles = synthesis.pole(np.array([m.frequency_hz for m in modes]), np.full(len(modes), 0.02))
    h = synthesis.accelerance(HZ, poles, np.array([m.residue for m in modes]))
    ones = np.ones((3, 3, len(HZ)))
    return Frf(HZ, h, 1e-9 * ones, 0.99 * ones, (1, 1, 1), (4.0, 40.0))


@pytest.fixture
def postures():
    """Two modes over nine postures."""
    modes = [[mode(10 + 0.1 * i), mode(25 - 0.2 * i)] for i in range(9)]
    return [frf(*row) for row in modes], modes


def test_good_modes_pass_all_steps(postures):
    frfs, modes = postures
    done = check(frfs, modes, [()] * 9)
    assert not done.doubted.any()
    assert not done.recovered.any()
    assert min(done.passed.values()) == 1.0
    assert all(m is n for row, old in zip(done.modes, modes, strict=True)
               for m, n in zip(row, old, strict=True))  # fmt: skip


def test_a_mode_far_from_its_neighbours_is_dropped(postures):
    frfs, modes = postures
    modes[4][1] = mode(31.0)
    done = check(frfs, modes, [()] * 9)
    assert done.modes[4][1] is None
    assert done.doubted.sum() == 1


def test_a_missing_peak_is_recovered_from_what_was_held_for_doubtful(postures):
    frfs, modes = postures
    true, modes[3][0] = modes[3][0], None
    spare: list[tuple[Mode, ...]] = [()] * 9
    spare[3] = (mode(10.35, 0.2), mode(18.0, 0.4))
    done = check(frfs, modes, spare)
    assert done.recovered[3, 0]
    found = done.modes[3][0]
    assert found is not None
    assert found.frequency_hz == pytest.approx(true.frequency_hz, rel=0.01)


def test_a_pole_without_peak_or_phase_is_dropped(postures):
    frfs, modes = postures
    frfs[5] = frf(modes[5][0])  # the second mode does not show there
    quiet = replace(frfs[5], coherence=np.full((3, 3, len(HZ)), 0.2))
    frfs[5] = quiet
    done = check(frfs, modes, [()] * 9)
    assert done.modes[5][1] is None
    assert done.modes[5][0] is modes[5][0]  # it has its peak
