"""Campaigns on the shipped robot, whose recordings are at hand."""

from pathlib import Path

from planner.campaign.campaign import Campaign
from planner.dataset.store import Store
from planner.demo import NAME, shipped
from planner.recording.folder import read_recordings
from planner.recording.records import PoseRow

RECORDINGS = shipped(NAME) / "recordings"


def shipped_campaign(parent: Path, more: str = "", store: Store | None = None) -> Campaign:
    """Begun in a folder of `parent`, without a measured pose; `more` goes into campaign.toml."""
    source, config = shipped(NAME), parent / "campaign.toml"
    config.write_text(f"{(source / config.name).read_text()}\n{more}")
    begun = Campaign.new(parent / "campaign", source / "robot" / "robot.toml", config)
    return Campaign(begun.directory, store)


def shipped_pool() -> dict[str, list[PoseRow]]:
    """What was recorded, by pose."""
    pool: dict[str, list[PoseRow]] = {}
    for row in read_recordings(RECORDINGS, tuple(f"joint_{i}" for i in range(1, 7))):
        pool.setdefault(row.pose, []).append(row)
    return pool
