"""Laws of a joint weighed one against the other, on a few noisy hits of concealed play."""

import pytest

from planner.truth.effects import NONLINEAR
from tests.support import separation_cases

KINDS = tuple(NONLINEAR)

EXACT = "\n[hits]\nangle_sd_deg = 0.01\noffset_sd_mm = 0.01\n"


@pytest.mark.parametrize(
    ("seed", "kinds"),
    [
        # Play was left half-way at a misfit of twice the noise, where softening was followed on.
        (8, KINDS),
        # Both explain all but noise: the better one by 47 nats, which counted for nothing.
        (3011, (*separation_cases.KINDS, *KINDS)),
    ],
)
def test_play_is_told_from_a_spring_that_is_not_linear(tmp_path, monkeypatch, seed, kinds):
    monkeypatch.setattr(separation_cases, "HIT_NOISE", 0.2)
    monkeypatch.setattr(separation_cases, "REPEATS", 1)
    # Along one axis a pose, hits that may miss leave more undecided than these laws differ by.
    monkeypatch.setattr(separation_cases, "HITS", EXACT)
    campaign = separation_cases.begun(seed, tmp_path, kinds)
    assert campaign.true[0] == "backlash"
    assert next(iter(campaign.tied.items())) == ((campaign.true,), pytest.approx(1.0, abs=0.05))
