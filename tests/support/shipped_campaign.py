"""Campaigns on the shipped robot, whose recordings are at hand."""

from pathlib import Path

from planner.campaign.campaign import Campaign
from planner.dataset.store import Store
from planner.demo import NAME, shipped

RECORDINGS = shipped(NAME) / "recordings"


def shipped_campaign(parent: Path, more: str = "", store: Store | None = None) -> Campaign:
    """Begun in a folder of `parent`, without a measured pose; `more` goes into campaign.toml."""
    source, config = shipped(NAME), parent / "campaign.toml"
    config.write_text(f"{(source / config.name).read_text()}\n{more}")
    begun = Campaign.new(parent / "campaign", source / "robot" / "robot.toml", config)
    return Campaign(begun.directory, store)
