"""A campaign's recordings as a folder that everything else reads."""

import pytest
from planner.campaign.table import write_table

from planner.campaign.campaign import Campaign
from planner.demo import NAME, Pool, shipped
from planner.errors import InputError
from planner.recording.folder import read_recordings


def test_hits_in_use_are_listed_and_nothing_else(tmp_path):
    source = shipped(NAME)
    toml = source / "robot" / "robot.toml"
    campaign = Campaign.new(tmp_path / "campaign", toml, source / "campaign.toml")
    names = campaign.cell.robot.joint_names
    with pytest.raises(InputError, match="import"):
        write_table(campaign.directory, campaign.state, names)
    pool = Pool.load(source / "recordings", names)
    for pose in list(pool.rows)[:2]:
        campaign.import_paths((pool.folder,), pose)
    folder = write_table(campaign.directory, campaign.state, names)
    rows = read_recordings(folder, names).rows
    hits = [hit for m in campaign.state.used for hit in m.accepted]
    assert [row.file.name[:64] for row in rows if row.file] == [hit.sha256 for hit in hits]
    assert {row.pose for row in rows} == set(list(pool.rows)[:2])
    assert not campaign.orphans()
    campaign.withdraw(rows[0].pose)
    folder = write_table(campaign.directory, campaign.state, names)
    assert len({row.pose for row in read_recordings(folder, names).rows}) == 1
