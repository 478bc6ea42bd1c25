"""A concealed case of the second engine, at which backlash under weight was looked at."""

import json

import pytest

from planner.proof.run import diagnosed
from planner.proof.tree.engine import make


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "joint"), [(337, "joint_4"), (374, "joint_3")])
def test_play_of_a_joint_that_its_weight_holds_at_one_end(tmp_path, seed, joint):
    made = make("backlash", seed, tmp_path)
    assert [c.at for c in made.concealed] == [joint]
    found = diagnosed(tmp_path)
    assert found["verdict"] == "explained", json.dumps(found["findings"])
    assert {(f["effect"], f["at"]) for f in found["findings"]} == {("backlash", joint)}
