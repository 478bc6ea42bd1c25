"""A diagnosis reads a campaign's recordings and writes nothing into its folder."""

import hashlib
from pathlib import Path

import numpy as np
import pytest

from planner.campaign.recordings_source import recordings_source
from planner.errors import InputError
from planner.progress import no_progress
from tests.support.outside import FROZEN, refused, told
from tests.support.shipped_campaign import RECORDINGS, shipped_campaign


def content(folder: Path) -> dict[str, tuple[str, int]]:
    """Hash and time of change of every file below a folder."""
    return {
        path.relative_to(folder).as_posix(): (
            hashlib.sha256(path.read_bytes()).hexdigest(),
            path.stat().st_mtime_ns,
        )
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    made = shipped_campaign(tmp_path_factory.mktemp("root"), FROZEN)
    with pytest.raises(InputError, match="import"):
        made.dataset(made.cell.config.modes.band_hz)
    for pose in ("A11", "A12"):
        made.import_paths((RECORDINGS,), pose)
    return made


def test_recordings_in_use_and_nothing_else(campaign):
    before = content(campaign.directory)
    given = recordings_source(campaign.directory, None, 0.0)
    recorded = given.read(campaign.cell.config.modes.band_hz, no_progress)
    assert len(recorded.ended_frfs) == len(recorded.modes) == len(recorded.visits) == 2
    used = campaign.state.used
    assert recorded.poses == tuple(m.pose for m in used)
    np.testing.assert_allclose(recorded.q, np.deg2rad([m.joints_deg for m in used]))
    hits = [hit.sha256 for m in used for hit in m.accepted]
    assert [hit.source.name[:64] for v in recorded.visits for hit in v.hits] == hits
    for measurement, frf in zip(used, recorded.frfs, strict=True):
        own = campaign.frf_of(measurement)
        np.testing.assert_array_equal(frf.accelerance, own.accelerance)
    assert recorded.simulated
    assert content(campaign.directory) == before


@pytest.mark.parametrize(
    ("command", "key"),
    [
        (("identify", "--no-extend", "--no-inertias"), "parameters"),
        pytest.param(("diagnose",), "findings", marks=[pytest.mark.slow, pytest.mark.timeout(600)]),
    ],
)
def test_identify_and_diagnose_leave_the_folder_byte_for_byte(campaign, command, key):
    before = content(campaign.directory)
    name, *options = command
    answer = told(name, campaign.directory, *options)
    assert key in answer
    assert answer["simulated"]
    assert content(campaign.directory) == before


def test_compare_takes_a_campaign_with_its_own_workspace(campaign):
    err = refused("compare", campaign.directory, "--strategies", "random")
    assert "The pool has 2 poses: 2 are left to judge by" in err
