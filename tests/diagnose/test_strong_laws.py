"""Strongly bent laws and what hangs twice, on cells of the other engine that once were "unknown".

pytest -m slow -s tests/diagnose/test_strong_laws.py (about 10 minutes on two cores). They are the
cells that the search was mended on: no proof, a guard.
"""

import json
import subprocess

import pytest

from planner.program import command
from planner.proof.tree.case import make_case, write_case

NAMED = (
    (417, {("local_resonator", "link_4")}),
    (418, {("backlash", "joint_3")}),
    (423, {("backlash", "joint_2"), ("local_resonator", "link_2")}),
    (425, {("nonlinear_stiffness", "joint_4")}),
    (426, {("local_resonator", "link_2"), ("joint_stiffness", "joint_3")}),
    (427, {("local_resonator", "link_4")}),
)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "there"), NAMED)
def test_it_is_named_where_it_is(seed, there, tmp_path):
    write_case(make_case(seed), tmp_path)
    robot = str(tmp_path / "robot" / "robot.toml")
    asked = command("diagnose", str(tmp_path / "recordings"), "--robot", robot, "--json")
    found = json.loads(subprocess.run(asked, capture_output=True, text=True, check=True).stdout)
    named = {(f["effect"], f["at"]) for f in found["findings"]}
    print(f"seed {seed}: {sorted(named)}, {found['seconds']:.0f} s")
    assert named == there
