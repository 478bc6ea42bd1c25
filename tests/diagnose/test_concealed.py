"""One hidden effect each, made by the other engine: pytest -m slow tests/diagnose -s"""

import numpy as np
import pytest

from planner.diagnosis.linear_diagnosis import diagnose
from planner.truth.deviation import Spring
from tests.support.concealed import hidden
from tests.support.known_robots import IRB6640, KR210

pytestmark = pytest.mark.slow


def told(diagnosis):
    for c in diagnosis.candidates[:4]:
        print(f"{c.places}: {c.probability:.3f}")
    print(f"{diagnosis.seconds:.1f} s")
    assert abs(sum(c.probability for c in diagnosis.candidates) - 1) < 1e-9
    return diagnosis.candidates[0].places[0]


def parameters(diagnosis):
    first = diagnosis.candidates[0]
    return first.fit.parameters(diagnosis.temper, first.effects[0])


def test_nothing_is_found_where_nothing_is_hidden(tmp_path):
    diagnosis = diagnose(*hidden(IRB6640, tmp_path, 71))
    assert told(diagnosis) == ("none", None)
    assert diagnosis.verdict == "consistent"


def test_soft_base(tmp_path):
    stiffness = (1.9e7, 1.2e7)
    axes = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    extra = tuple(Spring("base", a, k, 5e-4 * k) for a, k in zip(axes, stiffness, strict=True))
    diagnosis = diagnose(*hidden(KR210, tmp_path, 72, extra))
    assert told(diagnosis) == ("base_compliance", "base")
    assert diagnosis.verdict == "explained"
    found = parameters(diagnosis)
    for axis, k in zip("xy", stiffness, strict=True):
        assert abs(found[f"stiffness of base about {axis}"][0] / k - 1) < 0.02


@pytest.mark.parametrize("seed", range(81, 87))
def test_a_link_that_bends_and_twists_carries_no_mass_beside_it(tmp_path, seed):
    """How its mass is spread between its halves is not known, and not a mass."""
    rng = np.random.default_rng(seed)
    stiffness = np.exp(rng.uniform(np.log(1.0e6), np.log(4e6), 3))
    extra = tuple(
        Spring("link_2", (float(x), float(y), float(z)), float(k), 1e-3 * float(k))
        for (x, y, z), k in zip(np.eye(3), stiffness, strict=True)
    )
    diagnosis = diagnose(*hidden(KR210, tmp_path, seed, extra))
    told(diagnosis)
    assert diagnosis.candidates[0].places == (("link_flexibility", "link_2"),)


def test_gain_of_one_channel(tmp_path):
    def channel(a: np.ndarray) -> np.ndarray:
        return a * np.array([[1.0], [0.8], [1.0]])

    diagnosis = diagnose(*hidden(KR210, tmp_path, 73, channel=channel))
    assert told(diagnosis) == ("sensor_gain", "sensor_y")
    value, sd, _ = parameters(diagnosis)["gain"]
    assert sd < 0.015  # what ordinary tolerances of the other channels leave open of one gain
    assert abs(value - 0.8) < 2 * sd


def test_what_no_candidate_describes_is_unknown(tmp_path):
    def channel(a: np.ndarray) -> np.ndarray:  # cross-talk that depends on time
        ripple = np.sin(np.linspace(0, 40, a.shape[1]))
        return a + 0.3 * ripple * a[[1, 2, 0]]

    diagnosis = diagnose(*hidden(KR210, tmp_path, 74, channel=channel))
    told(diagnosis)
    assert diagnosis.verdict == "unexplained"
