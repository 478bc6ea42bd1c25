"""Recordings that a campaign has already: at which pose, and from which file."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from planner.campaign.events import HitRecord
from planner.campaign.state import CampaignState


@dataclass(frozen=True)
class KnownFile:
    """A delivered file whose data are in use, or are held, and the file that brought them first."""

    file: str
    first: str

    @property
    def copied(self) -> bool:
        """Whether it is another file."""
        return Path(self.file).absolute() != Path(self.first).absolute()


def owners(state: CampaignState) -> dict[str, str]:
    """Poses of all that is in use, or is held, by sha256."""
    return {hit.sha256: pose for pose, hit in _in_use(state)}


def first_files(state: CampaignState) -> dict[str, str]:
    """Names under which all that is in use, or is held, was imported, by sha256."""
    return {
        hit.sha256: hit.file.rpartition(" (hit ")[0] if hit.part else hit.file
        for _, hit in _in_use(state)
    }


def _in_use(state: CampaignState) -> Iterator[tuple[str, HitRecord]]:
    """All hits that are held, or in use, with their poses."""
    for pose, measurement in state.held.items():
        yield from ((pose, hit) for hit in measurement.hits)
    for measurement in state.measurements.values():
        if not measurement.withdrawn:
            yield from ((measurement.pose, hit) for hit in measurement.accepted)
