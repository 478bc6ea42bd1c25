"""Ways to get the input wrong, by tables: one plain sentence, exit 2 or 3, no traceback."""

import re
import shutil
from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np
import pytest

from planner.proof.hits import simulate_hit
from tests.support.bad_input import (
    bad_columns,
    hit_file_mutations,
    recording_mutations,
    table_mutations,
)
from tests.support.hit_files import WRITERS, columns
from tests.support.outside import HAMMER, call, told
from tests.support.robots import JOINTS_DEG

MIDDLE = [round((a + b) / 2, 3) for a, b in JOINTS_DEG]
JOINTS = ",".join(f"joint_a{i}_deg" for i in range(1, 7))
ROW = ",".join(map(str, MIDDLE))
POSES = [f"pose,{JOINTS}", f"H1,{ROW}", f"H2,{ROW}"]
IN_BAND = "--band-hz", 5, 110
Case = TypeVar("Case")


@pytest.fixture(scope="module")
def bench(first_pose_once, tmp_path_factory):
    """A campaign with a good recordings folder for it."""
    return first_pose_once.copied(tmp_path_factory.mktemp("bench"))


@pytest.fixture(scope="module")
def hit(bench):
    """A hit as named columns."""
    rng = np.random.default_rng(0)
    made = simulate_hit(bench.truth, np.deg2rad(MIDDLE), "+x", HAMMER, rng)
    return columns(made, HAMMER.sampling_rate_hz)


def fault(answer: tuple[int, str, str], *names: str) -> str:
    """What is wrong with the answer to bad input, which has one of the names; "": nothing."""
    code, out, err = answer
    lines = [line for line in err.splitlines() if line.strip()]
    right = [
        code in (2, 3),
        out == "",
        "Traceback" not in err,
        len(lines) == 1 or (lines and code == 3),
        all(line.endswith((".", "help", "]", "TOML")) or "; " in line for line in lines),
        not names or any(name in err for name in names),
    ]
    return "" if all(right) else f"exit {code}\n{out}\n{err}"


def faults(cases: Mapping[str, Case], judge: Callable[[Case], str]) -> dict[str, str]:
    """Of all cases those with a fault, and which."""
    return {name: found for name, case in cases.items() if (found := judge(case))}


def test_tables_of_poses(bench, tmp_path):
    bad = tmp_path / "bad.csv"

    def judge(content: bytes) -> str:
        bad.write_bytes(content)
        return fault(call("predict", bench.cell, bad, "--json"), bad.name)

    assert faults(table_mutations(POSES), judge) == {}


def test_tables_of_recordings(bench, tmp_path):
    folder = shutil.copytree(bench.made, tmp_path / "mutated")
    table, log = folder / "recordings.csv", bench.cell / "log.jsonl"
    # Of no proposed pose, whose joints would be known without a table.
    lines = table.read_text().replace(f"{bench.pose},", "G1,").splitlines()
    before = log.read_bytes()

    def judge(content: bytes) -> str:
        table.write_bytes(content)
        return fault(call("import", bench.cell, folder, "--json"), table.name)

    assert faults(table_mutations(lines) | recording_mutations(lines), judge) == {}
    assert log.read_bytes() == before


def test_universal_files(bench, tmp_path):
    bad, data = tmp_path / "bad_hit.uff", bench.files[0].read_bytes()

    def judge(content: bytes) -> str:
        bad.write_bytes(content)
        return fault(call("modes", bad, "--json"), bad.name, "No modes")

    assert faults(hit_file_mutations(data), judge) == {}


@pytest.mark.parametrize("suffix", WRITERS)
def test_named_columns(hit, tmp_path, suffix):
    bad = tmp_path / f"bad_hit{suffix}"
    WRITERS[suffix](bad, hit)
    assert len(told("modes", bad, *IN_BAND)["modes"]) >= 2
    whole = bad.read_bytes()
    for end in (100, len(whole) // 2):
        # A text table cut between two rows is a whole, shorter record: it is cut in a row.
        bad.write_bytes(whole[:end].rsplit(b",", 1)[0] if suffix == ".csv" else whole[:end])
        assert fault(call("modes", bad, "--json", *IN_BAND), bad.name) == ""

    def judge(table: dict[str, np.ndarray]) -> str:
        WRITERS[suffix](bad, table)
        return fault(call("modes", bad, "--json", *IN_BAND), bad.name, "No modes")

    every = bad_columns(hit)
    matrices = [every.pop(f"no acceleration_{axis}_m_s2") for axis in "xyz"]
    if suffix != ".csv":  # all may be wrong in one format, in others what their readers look for
        every = {what: every[what] for what in ("no time_s", "nan")}
    assert faults(every, judge) == {}
    for table in matrices if suffix == ".csv" else ():  # two sensors are no pose, but a matrix
        WRITERS[suffix](bad, table)
        assert len(told("modes", bad, *IN_BAND)["dofs"]) == 2


def replaced(old: str, new: str, count: int = -1):
    return lambda text: text.replace(old, new, count)


def added(lines: str):
    """The text with a table in place of the one of that name, if there is one."""
    table = lines.split("\n", maxsplit=1)[0]

    def change(text: str) -> str:
        parts = [part for part in text.split("\n\n") if table not in part]
        return "\n\n".join([*parts, lines]) + "\n"

    return change


def by_stability(cut: str):
    """The text with an acquisition that is about a cut."""
    return lambda text: f"{replaced('integrated_variance', 'stability')(text)}\n[cut]\n{cut}\n"


def with_tool_axis(axis: str):
    place = f"position_m = [[0.5, 0.7], [-0.2, 0.2], [0.4, 0.5]]\ntool_axis = {axis}"
    return lambda text: re.sub(r"joints_deg = .*", place, text)


STIFF = "stiffness = 60000.0"
BAND = "band_hz = [5.0, 110.0]"
# What is wrong in a file, and a part of the sentence that says so; test_robot_config.py has more.
CONFIGURATIONS = {
    "robot/robot.toml": {
        "urdf of no file system": (
            replaced('urdf = "arm.urdf"', 'urdf = "a\\u0000.urdf"'),
            "correct the entry urdf",
        ),
        "number without end": (replaced(STIFF, f"stiffness = {'6' * 5000}"), "thousands of digits"),
        "half": (lambda text: text[: len(text) // 2].rsplit("=", 1)[0], "robot.toml"),
        "nothing elastic": (lambda text: text.split("[[compliance]]")[0], "compliance"),
        "empty": (lambda text: "", "is missing; add it."),
    },
    "robot/arm.urdf": {
        "empty": (lambda text: "", "arm.urdf"),
        "joint that slides": (replaced('type="revolute"', 'type="prismatic"', 1), ""),
    },
    "plan/campaign.toml": {
        "key misspelt": (replaced("cou", "cuo"), '[modes] has no entry "cuont"; "count" may be'),
        "table misspelt": (replaced("[modes]", "[mdes]"), 'no entry "mdes"; "modes" may be meant.'),
        "a word": (replaced("count = 4", 'count = "four"'), "must be a whole number, not"),
        "no mode": (replaced("count = 4", "count = 0"), "[modes] count"),
        "five joints": (replaced("[[-40, 40], ", "["), "5 ranges"),
        "beyond a limit": (
            replaced("[-40, 40]", "[-400, 40]"),
            "limits are -170.0° to 170.0°; narrow",
        ),
        "upside down": (replaced("[[-40, 40]", "[[40, -40]"), "range 1 is [40, -40]; give finite"),
        "band upside down": (replaced(BAND, "band_hz = [40.0, 8.0]"), "band_hz is [40, 8]"),
        "unknown acquisition": (replaced("integrated_variance", "ei"), "there is no acquisition"),
        "unknown model": (
            added('[surrogate]\nmodel = "kriging"'),
            'no model "kriging"; choose one',
        ),
        "unknown kernel": (added('[surrogate]\nkernel = "cosine"'), 'there is no kernel "cosine"'),
        "no cut": (replaced("integrated_variance", "stability"), "needs [cut]"),
        "speed 0": (by_stability("speed_rpm = 0\ndepth_m = 1e-3"), "speed_rpm"),
        "no depth": (by_stability("speed_rpm = 3000\ndepth_m = -1e-3"), "depth_m"),
        "depth in mm": (by_stability("speed_rpm = 3000\ndepth_mm = 1.0"), "depth_mm"),
        "cut nowhere": (
            by_stability("speed_rpm = 3000\ndepth_m = 1e-3\njoints_deg = []"),
            "names no pose",
        ),
        "axis of length 2": (with_tool_axis("[0.0, 0.0, -2.0]"), "tool_axis is no unit vector"),
        "no end": (added("[goal]\njoints_deg = [[0, inf, 0, 0, 0, 0]]"), "joints_deg"),
        "empty": (lambda text: "", "is missing; add it."),
    },
}


@pytest.mark.parametrize("file", CONFIGURATIONS)
def test_configurations(bench, tmp_path, file):
    robot, plan = (
        shutil.copytree(path.parent, tmp_path / path.parent.name) / path.name
        for path in (bench.robot, bench.plan)
    )
    text = (tmp_path / file).read_text()

    def judge(case: tuple[Callable[[str], str], str]) -> str:
        change, words = case
        (tmp_path / file).write_text(change(text))
        assert (tmp_path / file).read_text() != text
        answer = call("new", tmp_path / "bad", "--robot", robot, "--campaign", plan, "--json")
        return fault(answer, words)

    assert faults(CONFIGURATIONS[file], judge) == {}
    assert not (tmp_path / "bad").exists()


def test_a_folder_instead_of_its_robot(bench):
    said = {folder: f"is a folder; name {bench.robot}." for folder in bench.robot.parents[:2]}
    said[bench.plan.parent] = "name a robot.toml in it"
    for folder, words in said.items():
        assert fault(call("check", folder), words) == ""


# What is typed, and a part of what is said of it.
COMMANDS = {
    "next ROOT/nowhere": "",
    "status GOOD": "",
    "next CELL --count 0": "",
    "next CELL --acquisition crystal_ball": "",
    "import CELL ROOT/nowhere": "",
    "import CELL GOOD/data --pose never_proposed": "",
    "import CELL GOOD --pose G9 --json --nonsense": "",
    "withdraw CELL P999": "",
    "skip CELL P999": "",
    "predict CELL ROOT/nowhere.csv": "",
    "predict CELL POSES --out GOOD/recordings.csv/x.npz": "",
    "replay CELL --until 0": "",
    "modes ROOT/nowhere.uff": "",
    "modes POSES": "",
    "new CELL --robot ROOT/robot/robot.toml": "",
    "new ROOT/fresh": "--example",
    "new": "see planner new --help.",  # a missing argument points to the command's own help
    "study seed-9": "choose one of busch2022",
    "study seyedhosseini2025 --out POSES": "name another folder",
    "frobnicate": "",
}


def test_commands(bench, tmp_path):
    poses = tmp_path / "predict.csv"
    poses.write_text("\n".join(POSES) + "\n")
    root, good, cell = bench.robot.parents[1], bench.made, bench.cell
    places = {"ROOT": root, "GOOD": good, "CELL": cell, "POSES": poses}

    def judge(command: str) -> str:
        words = command.split()
        for name, place in places.items():
            words = [word.replace(name, str(place)) for word in words]
        return fault(call(*words), COMMANDS[command])

    assert faults({command: command for command in COMMANDS}, judge) == {}


def test_huge_files_are_refused_without_reading_them(bench, tmp_path):
    for suffix in ("uff", "mat", "csv"):
        huge = tmp_path / f"huge.{suffix}"
        with open(huge, "wb") as file:
            file.truncate(2**29 + 1)
        assert fault(call("modes", huge, "--json"), huge.name, "No modes") == ""
        assert fault(call("import", bench.cell, huge, "--pose", "G1")) == ""
    assert fault(call("predict", bench.cell, huge, "--json")) == ""
    assert sum(p.stat().st_size for p in bench.cell.rglob("*") if p.is_file()) < 10**8


def test_damaged_log_exits_5(first_pose):
    log = first_pose.cell / "log.jsonl"
    data = log.read_bytes()
    log.write_bytes(data[:40] + b"#" + data[41:])
    code, out, err = call("status", first_pose.cell, "--json")
    assert (code, out) == (5, "")
    assert "line 1" in err
