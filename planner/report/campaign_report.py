"""Answer of `report`: where the file is."""

import time
from pathlib import Path

from planner.campaign.campaign import Campaign
from planner.errors import InputError
from planner.report.answer import Done
from planner.words import counted


def write_report(campaign: Campaign, out: Path | None, diagnosis: Path | None) -> Done:
    """Write the report of a campaign, by default report.html in its folder.

    `diagnosis` names what `planner diagnose --out` has written. Raises InputError where the file
    cannot be written.
    """
    from planner.report.kept_diagnosis import diagnosis_of
    from planner.report.page import page

    started = time.perf_counter()
    kept = diagnosis_of(campaign.directory, diagnosis)
    file = (out or campaign.directory / "report.html").absolute()
    if file.is_dir():
        raise InputError(f"{file} is a folder; name a file for the report.")
    if not file.parent.is_dir():
        raise InputError(f"{file.parent} does not exist; make that folder, or name another.")
    data = page(campaign, kept).encode("utf-8", "replace")
    try:
        file.write_bytes(data)
    except OSError as error:
        raise InputError(f"{file} cannot be written ({error.strerror}); name another.") from None
    used, simulated = len(campaign.state.used), campaign.state.simulated
    keys = {
        "report": str(file), "bytes": len(data), "measurements": used, "simulated": simulated,
        "diagnosis": str(kept) if kept else None, "seconds": time.perf_counter() - started,
    }  # fmt: skip
    return Done(keys, f"Report of {counted(used, 'pose')} ({len(data) / 1e6:.1f} MB): {file}")
