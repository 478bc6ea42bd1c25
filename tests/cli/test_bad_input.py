"""Ways to get the input wrong, a test each: one plain sentence, exit 2 or 3, no traceback."""

import json
import shutil

import numpy as np
import pytest

from planner.truth.hits import simulate_hit
from tests.support.bad_input import (
    bad_columns,
    hit_file_mutations,
    recording_mutations,
    table_mutations,
)
from tests.support.hit_files import NAMES, WRITERS, columns
from tests.support.outside import HAMMER, call
from tests.support.robots import JOINTS_DEG

MIDDLE = [round((a + b) / 2, 3) for a, b in JOINTS_DEG]
JOINTS = ",".join(f"joint_a{i}_deg" for i in range(1, 7))
ROW = ",".join(map(str, MIDDLE))
POSES = [f"pose,{JOINTS}", f"H1,{ROW}", f"H2,{ROW}"]
# Only the names of mutations are taken from these, before there is a recording.
LIKE_RECORDINGS = [f"pose,{JOINTS},hit,repeat,file", *[f"G1,{ROW},+x,1,data/G1_px_1.uff"] * 2]
LIKE_COLUMNS = {name: np.arange(99.0) for name in ("time_s", *NAMES)}


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


def expect_one_sentence(code: int, out: str, err: str, *names: str) -> None:
    assert code in (2, 3), f"exit {code}\n{out}\n{err}"
    assert "Traceback" not in err + out
    assert out == ""
    lines = [line for line in err.splitlines() if line.strip()]
    assert lines
    if code == 2:
        assert len(lines) == 1, err
    assert all(line.endswith((".", "help", "]", "TOML")) or "; " in line for line in lines), err
    if names:
        assert any(name in err for name in names), err


@pytest.mark.parametrize("what", table_mutations(POSES))
def test_tables(bench, tmp_path, what):
    bad = tmp_path / "bad.csv"
    bad.write_bytes(table_mutations(POSES)[what])
    expect_one_sentence(*call("predict", bench.cell, bad, "--json"), "bad.csv")


@pytest.mark.parametrize(
    "what", table_mutations(LIKE_RECORDINGS) | recording_mutations(LIKE_RECORDINGS)
)
def test_tables_of_recordings(bench, tmp_path, what):
    lines = (bench.made / "recordings.csv").read_text().splitlines()
    folder = shutil.copytree(bench.made, tmp_path / "mutated")
    mutations = table_mutations(lines) | recording_mutations(lines)
    (folder / "recordings.csv").write_bytes(mutations[what])
    before = (bench.cell / "log.jsonl").read_bytes()
    expect_one_sentence(*call("import", bench.cell, folder, "--json"), "recordings.csv")
    assert (bench.cell / "log.jsonl").read_bytes() == before


@pytest.mark.parametrize("what", hit_file_mutations(b"like a file"))
def test_universal_files(bench, tmp_path, what):
    data = next((bench.made / "data").glob("*px_1.uff")).read_bytes()
    bad = tmp_path / "bad_hit.uff"
    bad.write_bytes(hit_file_mutations(data)[what])
    expect_one_sentence(*call("modes", bad, "--json"), "bad_hit.uff", "No modes")


@pytest.mark.parametrize("suffix", WRITERS)
def test_named_columns(hit, tmp_path, suffix):
    good = tmp_path / f"good_hit{suffix}"
    WRITERS[suffix](good, hit)
    code, out, err = call("modes", good, "--json", "--band-hz", 5, 110)
    assert code == 0, err
    assert len(json.loads(out)["modes"]) >= 2


# All that may be wrong in one format, and in the others what their readers look for themselves.
BAD_COLUMNS = [(what, ".csv") for what in bad_columns(LIKE_COLUMNS)]
BAD_COLUMNS += [(what, s) for what in ("no time_s", "nan") for s in WRITERS if s != ".csv"]


@pytest.mark.parametrize(("what", "suffix"), BAD_COLUMNS)
def test_bad_named_columns(hit, tmp_path, suffix, what):
    bad = tmp_path / f"bad_hit{suffix}"
    WRITERS[suffix](bad, bad_columns(hit)[what])
    answer = call("modes", bad, "--json", "--band-hz", 5, 110)
    if what.startswith("no acceleration"):  # two sensors are no pose, but a matrix
        assert answer[0] == 0
        assert len(json.loads(answer[1])["dofs"]) == 2
        return
    expect_one_sentence(*answer, bad.name, "No modes")


@pytest.mark.parametrize("suffix", WRITERS)
@pytest.mark.parametrize("cut", ["100 bytes", "half"])
def test_named_columns_cut_short(hit, tmp_path, suffix, cut):
    bad = tmp_path / f"bad_hit{suffix}"
    WRITERS[suffix](bad, hit)
    whole = bad.read_bytes()
    kept = whole[: 100 if cut == "100 bytes" else len(whole) // 2]
    if suffix == ".csv":
        # A text table cut between two rows is a whole, shorter record: it is cut in a row.
        kept = kept.rsplit(b",", 1)[0]
    bad.write_bytes(kept)
    expect_one_sentence(*call("modes", bad, "--json", "--band-hz", 5, 110), bad.name)


def replaced(old: str, new: str, count: int = -1):
    return lambda text: text.replace(old, new, count)


def added(lines: str):
    """The text with a table in place of the one of that name, if there is one."""
    table = lines.split("\n", maxsplit=1)[0]

    def change(text: str) -> str:
        parts = [part for part in text.split("\n\n") if table not in part]
        return "\n\n".join([*parts, lines]) + "\n"

    return change


STIFF = "stiffness = 60000.0"
BAND = "band_hz = [5.0, 110.0]"
# What is wrong in a file, and a part of the sentence that says so; test_robot_config.py has more.
CONFIGURATIONS = {
    "robot/robot.toml": {
        "no urdf": (replaced('urdf = "arm.urdf"\n', ""), "urdf is missing; add it."),
        "urdf of no file system": (
            replaced('urdf = "arm.urdf"', 'urdf = "a\\u0000.urdf"'),
            "correct the entry urdf",
        ),
        "stiffness a word": (
            replaced(STIFF, 'stiffness = "high"'),
            "[[compliance]] stiffness must be a number, not",
        ),
        "number without end": (replaced(STIFF, f"stiffness = {'6' * 5000}"), "thousands of digits"),
        "key misspelt": (
            replaced("damping = ", "dampening = ", 1),
            '[[compliance]] has no entry "dampening"; "damping" may be meant.',
        ),
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
        "unknown table": (lambda text: text + "[surprise]\nx = 1\n", "surprise"),
        "a word": (replaced("count = 4", 'count = "four"'), "must be a whole number, not"),
        "number without end": (replaced("count = 4", f"count = {'4' * 5000}"), "thousands"),
        "no mode": (replaced("count = 4", "count = 0"), "[modes] count"),
        "five joints": (replaced("[[-40, 40], ", "["), "5 ranges"),
        "a range of words": (replaced("[[-40, 40]", '[["a", 40]'), "joints_deg must be a number"),
        "beyond a limit": (replaced("[-40, 40]", "[-400, 40]"), "joints_deg of joint_a1"),
        "upside down": (replaced("[[-40, 40]", "[[40, -40]"), "range 1 is [40, -40]; give finite"),
        "band upside down": (replaced(BAND, "band_hz = [40.0, 8.0]"), "band_hz is [40, 8]"),
        "unknown acquisition": (replaced("integrated_variance", "ei"), "there is no acquisition"),
        "unknown model": (
            added('[surrogate]\nmodel = "kriging"'),
            'no model "kriging"; choose one',
        ),
        "unknown kernel": (added('[surrogate]\nkernel = "cosine"'), 'there is no kernel "cosine"'),
        "no end": (added("[goal]\njoints_deg = [[0, inf, 0, 0, 0, 0]]"), "joints_deg"),
        "empty": (lambda text: "", "is missing; add it."),
    },
}


@pytest.mark.parametrize(
    ("file", "what"), [(file, what) for file, each in CONFIGURATIONS.items() for what in each]
)
def test_configurations(bench, tmp_path, file, what):
    for folder in (bench.robot.parent, bench.plan.parent):
        shutil.copytree(folder, tmp_path / folder.name)
    text, (change, words) = (tmp_path / file).read_text(), CONFIGURATIONS[file][what]
    (tmp_path / file).write_text(change(text))
    assert (tmp_path / file).read_text() != text
    robot, plan = tmp_path / "robot" / "robot.toml", tmp_path / "plan" / "campaign.toml"
    answer = call("new", tmp_path / "bad", "--robot", robot, "--campaign", plan, "--json")
    expect_one_sentence(*answer, words)
    assert not (tmp_path / "bad").exists()


def test_a_folder_instead_of_its_robot(bench, tmp_path):
    for folder in bench.robot.parents[:2]:
        expect_one_sentence(*call("check", folder), f"is a folder; name {bench.robot}.")
    expect_one_sentence(*call("check", bench.plan.parent), "name a robot.toml in it")


SAID = {
    "new ROOT/fresh": "--example",
    "study seed-9": "choose one of busch2022",
    "study seyedhosseini2025 --out POSES": "name another folder",
}


@pytest.mark.parametrize(
    "command",
    [
        "next ROOT/nowhere",
        "status GOOD",
        "next CELL --count 0",
        "next CELL --acquisition crystal_ball",
        "import CELL ROOT/nowhere",
        "import CELL GOOD/data --pose never_proposed",
        "import CELL GOOD --pose G9 --json --nonsense",
        "withdraw CELL P999",
        "skip CELL P999",
        "predict CELL ROOT/nowhere.csv",
        "predict CELL POSES --out GOOD/recordings.csv/x.npz",
        "replay CELL --until 0",
        "modes ROOT/nowhere.uff",
        "modes POSES",
        "new CELL --robot ROOT/robot/robot.toml",
        "new ROOT/fresh",
        "frobnicate",
        *("new", "import", "check"),
        "study seed-9",
        "study seyedhosseini2025 --out POSES",
    ],
)
def test_usage(bench, tmp_path, command):
    poses = tmp_path / "predict.csv"
    poses.write_text("\n".join(POSES) + "\n")
    root, good, cell = bench.robot.parents[1], bench.made, bench.cell
    places = {"ROOT": root, "GOOD": good, "CELL": cell, "POSES": poses}
    words = command.split()
    for name, place in places.items():
        words = [word.replace(name, str(place)) for word in words]
    # A missing argument points to the command's own help.
    helped = f"see planner {command} --help." if command in ("import", "check") else ""
    expect_one_sentence(*call(*words), SAID.get(command, helped))


@pytest.mark.parametrize("suffix", ["uff", "mat", "csv"])
def test_huge_files_are_refused_without_reading_them(bench, tmp_path, suffix):
    huge = tmp_path / f"huge.{suffix}"
    with open(huge, "wb") as file:
        file.truncate(2**30)
    expect_one_sentence(*call("modes", huge, "--json"), huge.name, "No modes")
    expect_one_sentence(*call("import", bench.cell, huge, "--pose", "G1"))
    if suffix == "csv":
        expect_one_sentence(*call("predict", bench.cell, huge, "--json"))
    assert sum(p.stat().st_size for p in bench.cell.rglob("*") if p.is_file()) < 10**8
    huge.unlink()


def test_damaged_log_exits_5(first_pose):
    log = first_pose.cell / "log.jsonl"
    data = log.read_bytes()
    log.write_bytes(data[:40] + b"#" + data[41:])
    code, out, err = call("status", first_pose.cell, "--json")
    assert (code, out) == (5, "")
    assert "line 1" in err
