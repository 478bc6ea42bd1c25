"""A campaign's own recordings as a folder with recordings.csv, for all that reads such folders."""

import csv
import io
from pathlib import Path

from planner.campaign import store
from planner.campaign.journal import write_synced
from planner.campaign.state import CampaignState
from planner.errors import InputError
from planner.recording.folder import TABLE


def write_table(directory: Path, state: CampaignState, joint_names: tuple[str, ...]) -> Path:
    """Write recordings/recordings.csv beside the kept copies; returns the folder.

    It is derived from the log, anew each time: accepted hits of all poses in use, in the order of
    import. Raises InputError where there are none.
    """
    folder = directory / store.RECORDINGS
    text = io.StringIO()
    table = csv.writer(text)
    table.writerow(["pose", *(f"{name}_deg" for name in joint_names), "hit", "repeat", "file"])
    rows = 0
    for measurement in state.used:
        for hit in measurement.accepted:
            if hit.hit is None:
                continue
            repeat = "" if hit.repeat is None else hit.repeat
            file = store.recording_path(directory, hit.sha256, hit.suffix).name
            table.writerow([measurement.pose, *measurement.joints_deg, hit.hit, repeat, file])
            rows += 1
    if not rows:
        raise InputError(f"{directory} holds no hits yet; import recordings first.")
    write_synced(folder / TABLE, text.getvalue().encode())
    return folder
