"""What another acquisition would have made of a campaign."""

import numpy as np

from tests.support.outside import make_cell, record, told

MEASUREMENTS = 3


def test_what_another_acquisition_would_have_proposed_and_saved(tmp_path):
    robot, campaign_toml, truth = make_cell(tmp_path, learns=False)
    cell, measured = tmp_path / "cell", []
    told("new", cell, "--robot", robot, "--campaign", campaign_toml)
    for number in range(MEASUREMENTS + 2):
        (proposal,) = told("next", cell)["proposals"]
        measured.append(proposal["pose"])
        told("import", cell, record(truth, tmp_path / f"export{number}", measured[-1],
                                    proposal["joints_deg"], seed=number))  # fmt: skip
    replayed = told("replay", cell, "--acquisition", "variance")
    assert replayed["reproduced"]
    proposed = [step for step in replayed["steps"] if step["event"] == "proposed"]
    assert proposed
    assert all(len(step["instead"]) == 1 for step in proposed)
    assert all(not step["instead"] for step in replayed["steps"] if step["event"] == "imported")
    runs = replayed["otherwise"]["runs"]
    was, other = runs["campaign"], runs["variance"]
    assert was["poses"] == measured[: len(was["poses"])]
    assert other["poses"][0] == was["poses"][0]
    assert len(set(other["poses"])) == len(was["poses"]) == len(measured) - 2
    assert was["n"] == other["n"]
    assert np.all(np.diff(other["minutes"]) > 0)
    assert "variance would have needed" in replayed["otherwise"]["text"]
