"""A small campaign on shipped recordings whose names are meant to break what shows them."""

import csv
import shutil
from pathlib import Path

from planner.campaign.campaign import Campaign
from planner.demo import NAME, shipped

SCRIPT, DOLLAR = "<script>alert(1)</script>", "P$2$ & co"
LAST_REPEAT = 2  # two hits an axis are enough


def named_campaign(folder: Path) -> Campaign:
    """Two measured poses with unpleasant names, and a refused recording."""
    source = shipped(NAME)
    with (source / "recordings" / "recordings.csv").open() as file:
        rows = list(csv.DictReader(file))
    names = {"A34": SCRIPT, "A23": DOLLAR}
    chosen = [r for r in rows if r["pose"] in names and int(r["repeat"]) <= LAST_REPEAT]
    export = folder / "export"
    (export / "data").mkdir(parents=True)
    for row in chosen:
        shutil.copy(source / "recordings" / row["file"], export / row["file"])
        row["pose"] = names[row["pose"]]
    broken = {**chosen[0], "repeat": "9", "file": "data/<b>torn.uff"}
    (export / broken["file"]).write_bytes((export / chosen[0]["file"]).read_bytes()[:3000])
    with (export / "recordings.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, chosen[0])
        writer.writeheader()
        writer.writerows([*chosen, broken])
    plan = folder / "campaign.toml"
    text = (source / "campaign.toml").read_text().replace("count = 4", "count = 2")
    name = 'name = "integrated_variance"'
    text = text.replace(name, f"{name}\ncandidates = 40")
    plan.write_text(f'{text}[fidelity]\nsimulation = "frozen" # <i>frozen</i>\n')
    campaign = Campaign.new(folder / "cell", source / "robot" / "robot.toml", plan)
    campaign.next()
    campaign.import_paths((export,))
    return campaign
