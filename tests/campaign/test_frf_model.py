"""FRFs of a campaign: what is left out says what to trust, and how far off FRFs are elsewhere.

How good they are on fifty robots: test_everyday_campaigns.py.
"""

import numpy as np
import pytest

from planner.campaign.campaign import Campaign
from planner.campaign.frf_model import ErrorByZone
from planner.dataset.store import Store
from planner.frf.metrics import agreement, direct_mean
from planner.surrogate.leave_one_out import left_out_modes
from planner.surrogate.modal_surrogate import fit_surrogate
from tests.support.case_campaigns import CaseCampaign, FrfScore, lacking
from tests.support.surrogates import observed


def test_modes_left_out_are_those_of_a_fit_without_the_pose():
    seen = observed(8, 1)
    found = left_out_modes(fit_surrogate(seen), seen)
    for i in (0, 5):
        kept = np.arange(8) != i
        there = fit_surrogate(seen[kept]).predict(seen.x[[i]], seen.simulated[[i]])
        gap = np.abs(np.log(found.frequency_hz[i] / there.frequency_hz[0]))
        assert np.all(gap < 0.6 * there.frequency_sd_hz[0] / there.frequency_hz[0])
        size = np.abs(there.residue[0]).max()
        np.testing.assert_allclose(found.residue[i], there.residue[0], atol=0.1 * size)


def test_missing_modes_are_predicted_where_they_are_left_out():
    seen = observed(6, 1)
    seen.frequency_hz[2, 1] = np.nan
    seen.residue[3, 0] = np.nan
    found = left_out_modes(fit_surrogate(seen), seen)
    assert all(np.all(np.isfinite(values)) for values in vars(found).values())


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    """A robot on a soft base that nobody knows of, hit as people hit."""
    return lacking("kr210", "soft base", 1, tmp_path_factory.mktemp("base"))


def test_frfs_of_a_soft_base_get_better_with_the_second_pose(base: CaseCampaign):
    first, second = (FrfScore.of(base.case, base.after(n)) for n in (1, 2))
    print(first, second)
    assert second.frac > 0.995
    assert second.frac > first.frac - 0.002
    assert second.frac > second.alone - 1e-4  # both are 0.9999…
    assert second.covered > 0.9
    assert min(second.covered_low, second.covered_high) > 0.85


def test_without_a_simulation_frfs_are_those_of_fused_modes_and_less_sure(tmp_path):
    campaign = lacking("kr210", "nothing", 2, tmp_path, simulation="none")
    case, model = campaign.case, campaign.after(2)
    mean, sd = model.frf(case.unseen, case.lines_hz)
    fused, fused_sd = model._modal_frf(case.unseen, case.lines_hz)
    np.testing.assert_allclose(mean, fused)
    assert np.all(sd > fused_sd)
    assert np.mean(np.abs(mean - case.true_frf) <= 2 * sd) > 0.85


def test_before_any_measurement_the_simulation_as_stated_says_what_to_expect(base):
    model, q, lines = base.after(0), base.case.unseen[:1], base.case.lines_hz
    mean, sd = model.frf(q, lines)
    assert "frf_error" not in vars(model)
    stated = base.cell.simulation.accelerance(q, lines)
    low = lines < 20
    assert direct_mean(agreement(stated[..., low], mean[..., low]).global_frac) > 0.6
    assert np.all(sd > 0)


def test_what_was_worked_out_for_frfs_is_kept(two_poses, tmp_path, monkeypatch):
    store = Store(tmp_path / "models")
    campaign = Campaign(two_poses[0].directory, store)
    q = campaign.cell.candidates.q[:1]
    assert not campaign.model.knows_frfs
    first = campaign.frf_at(q)

    def refused(*given):
        raise AssertionError("worked out again")

    monkeypatch.setattr(ErrorByZone, "of", refused)
    again = Campaign(campaign.directory, store).frf_at(q)
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
