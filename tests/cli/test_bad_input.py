"""Two hundred ways to get the input wrong: one plain sentence each, exit 2 or 3, no traceback."""

import contextlib
import io
import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from planner.cli.run import run
from planner.truth.hits import simulate_hit
from tests.support.outside import HAMMER, make_cell, record
from tests.support.robots import JOINTS_DEG

MIDDLE = [round((a + b) / 2, 3) for a, b in JOINTS_DEG]


def call(*arguments: object) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run([str(a) for a in arguments])
    return code, out.getvalue(), err.getvalue()


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A campaign, a good recordings folder for it, and a table of poses."""
    root = tmp_path_factory.mktemp("bench")
    robot, campaign_toml, truth = make_cell(root)
    assert call("new", root / "cell", "--robot", robot, "--campaign", campaign_toml)[0] == 0
    good = record(truth, root / "good", "G1", MIDDLE)
    poses = root / "predict.csv"
    header = ",".join(["pose", *(f"joint_a{i}_deg" for i in range(1, 7))])
    poses.write_text(
        f"{header}\nH1,{','.join(map(str, MIDDLE))}\nH2,{','.join(map(str, MIDDLE))}\n"
    )
    hit = simulate_hit(truth, np.deg2rad(MIDDLE), "+x", HAMMER, np.random.default_rng(0))
    return root, good, poses, hit


def expect_one_sentence(code: int, out: str, err: str, what: str, *names: str) -> None:
    assert code in (2, 3), f"{what}: exit {code}\n{out}\n{err}"
    assert "Traceback" not in err + out, what
    assert out == "", f"{what}: {out}"
    lines = [line for line in err.splitlines() if line.strip()]
    assert lines, what
    if code == 2:
        assert len(lines) == 1, f"{what}: {err}"
    assert all(line.endswith((".", "help", "]", "TOML")) or "; " in line for line in lines), err
    if names:
        assert any(name in err for name in names), f"{what}: {err}"


def edited(lines: list[str], row: int, column: int, cell: str) -> list[str]:
    cells = lines[row].split(",")
    cells[column] = cell
    return [*lines[:row], ",".join(cells), *lines[row + 1 :]]


def table_mutations(lines: list[str]) -> dict[str, str | bytes]:
    """Mutations that both tables share; column 1…6 are joints, column 0 the pose."""

    def text(rows):
        return "\n".join(rows) + "\n"

    found: dict[str, str | bytes] = {
        "empty": "",
        "header only": text(lines[:1]),
        "binary junk": bytes(range(256)) * 20,
        "latin-1": "pose,größe\nx,1\n".encode("latin-1"),
        "no header": text(lines[1:]),
        "cut in a row": text(lines)[: len(text(lines)) // 2].rsplit(",", 1)[0] + "\n",
        "extra cell": text([lines[0], lines[1] + ",9", *lines[2:]]),
        "nul": text(lines).replace("1", "\x00", 1),
        "duplicate column": text([lines[0].replace("joint_a2", "joint_a1"), *lines[1:]]),
        "wrong joint name": text([lines[0].replace("joint_a2", "axis_2"), *lines[1:]]),
        "seventh joint": text([f"{lines[0]},joint_a7_deg", *(f"{line},0" for line in lines[1:])]),
        "radians columns": text([lines[0].replace("_deg", "_rad"), *lines[1:]]),
        "no pose name": text(edited(lines, 1, 0, "")),
    }
    for joint in range(1, 7):
        found[f"joint {joint} missing"] = text(
            [",".join(c for i, c in enumerate(line.split(",")) if i != joint) for line in lines]
        )
        for cell in ("nan", "inf", "", "12,5", "abc", "1e99"):
            found[f"joint {joint} is {cell!r}"] = text(edited(lines, 1, joint, cell))
        found[f"joint {joint} beyond limit"] = text(edited(lines, 1, joint, "400"))
        swapped = [*lines]
        found[f"joint {joint} in arc minutes"] = text(edited(swapped, 1, joint, "9000"))
    return found


def recording_mutations(lines: list[str]) -> dict[str, str]:
    """Mutations of recordings.csv alone."""
    last = len(lines[0].split(",")) - 1

    def text(rows):
        return "\n".join(rows) + "\n"

    return {
        "hit axis w": text(edited(lines, 1, last - 2, "+w")),
        "hit empty": text(edited(lines, 1, last - 2, "")),
        "repeat a word": text(edited(lines, 1, last - 1, "first")),
        "repeat half": text(edited(lines, 1, last - 1, "1.5")),
        "file missing": text(edited(lines, 1, last, "data/none.uff")),
        "file outside": text(edited(lines, 1, last, "../predict.csv")),
        "file empty": text(edited(lines, 1, last, "")),
        "file junk name": text(edited(lines, 1, last, "data/\x7f" * 300)),
        "same row twice": text([*lines, lines[1]]),
        "same repeat twice": text(edited(lines, 2, last - 1, "1")),
        "pose elsewhere": text(edited(lines, 2, 1, "39")),
    }


def test_tables(bench):
    root, good, poses, _ = bench
    count = 0
    lines = poses.read_text().splitlines()
    bad = root / "bad.csv"
    for what, content in table_mutations(lines).items():
        bad.write_bytes(content if isinstance(content, bytes) else content.encode())
        expect_one_sentence(*call("predict", root / "cell", bad, "--json"), what, "bad.csv")
        count += 1
    lines = (good / "recordings.csv").read_text().splitlines()
    mutations = table_mutations(lines) | recording_mutations(lines)
    folder = root / "mutated"
    shutil.copytree(good, folder)
    before = (root / "cell" / "log.jsonl").read_bytes()
    for what, content in mutations.items():
        data = content if isinstance(content, bytes) else content.encode()
        (folder / "recordings.csv").write_bytes(data)
        code, out, err = call("import", root / "cell", folder, "--json")
        expect_one_sentence(code, out, err, what, "recordings.csv")
        assert (root / "cell" / "log.jsonl").read_bytes() == before, what
        count += 1
    print(f"{count} mutated tables")
    assert count >= 120


def hit_file_mutations(good: bytes, other: bytes) -> dict[str, bytes]:
    rng = np.random.default_rng(7)
    found = {
        "empty": b"",
        "binary junk": rng.integers(0, 256, 5000, dtype=np.uint8).tobytes(),
        "text": b"this is no recording\n" * 30,
        "nan samples": other,
        "zeros": b"\x00" * 4000,
    }
    for i, cut in enumerate(rng.integers(1, len(good) - 1, 30)):
        found[f"cut {i} at {cut}"] = good[:cut]
    return found


def test_universal_files(bench):
    root, good, _, _ = bench
    source = next((good / "data").glob("*px_1.uff"))
    data = source.read_bytes()
    # All-ones bytes are a NaN in every binary float format.
    half = len(data) // 2
    nan = data[:half] + b"\xff" * 64 + data[half + 64 :]
    for what, content in hit_file_mutations(data, nan).items():
        bad = root / "bad_hit.uff"
        bad.write_bytes(content)
        expect_one_sentence(*call("modes", bad, "--json"), what, "bad_hit.uff", "No modes")


def columns(hit) -> dict[str, np.ndarray]:
    n = hit.force_n.size
    names = [f"acceleration_{a}_m_s2" for a in "xyz"]
    return {
        "time_s": np.arange(n) / HAMMER.sampling_rate_hz,
        "force_n": hit.force_n,
        **dict(zip(names, hit.acceleration_m_s2, strict=True)),
    }


def bad_columns(hit) -> dict[str, dict[str, np.ndarray]]:
    good = columns(hit)
    uneven = good["time_s"].copy()
    uneven[50:] += 0.01
    spoilt = good["force_n"].copy()
    spoilt[10] = np.nan
    without = {f"no {name}": {k: v for k, v in good.items() if k != name} for name in good}
    return {
        **without,
        "uneven": {**good, "time_s": uneven},
        "backwards": {**good, "time_s": good["time_s"][::-1]},
        "nan": {**good, "force_n": spoilt},
        "silent": {**good, "force_n": np.zeros_like(spoilt)},
        "negative": {**good, "force_n": -good["force_n"]},
        "noise only": {**good, "force_n": np.random.default_rng(0).standard_normal(spoilt.size)},
        "clipped": {**good, "acceleration_x_m_s2": np.clip(good["acceleration_x_m_s2"], -1, 1)},
        "two samples": {k: v[:2] for k, v in good.items()},
        "swapped": {
            **good,
            "force_n": good["acceleration_y_m_s2"],
            "acceleration_y_m_s2": good["force_n"],
        },
        "force in an unknown unit": {
            ("force_parsec" if k == "force_n" else k): v for k, v in good.items()
        },
    }


def write_csv(path: Path, table: dict[str, np.ndarray]) -> None:
    rows = [",".join(repr(float(v)) for v in row) for row in zip(*table.values(), strict=True)]
    path.write_text("\n".join(["hit = +x", ",".join(table), *rows]) + "\n")


def write_mat(path: Path, table: dict[str, np.ndarray]) -> None:
    scipy.io.savemat(path, {**table, "hit": "+x"})


def write_h5(path: Path, table: dict[str, np.ndarray]) -> None:
    with h5py.File(path, "w") as file:
        file.attrs["hit"] = "+x"
        for name, values in table.items():
            file[name] = values


def write_tdms(path: Path, table: dict[str, np.ndarray]) -> None:
    from nptdms import ChannelObject, RootObject, TdmsWriter

    with TdmsWriter(str(path)) as writer:
        root = RootObject(properties={"hit": "+x"})
        writer.write_segment([root, *(ChannelObject("hit", n, v) for n, v in table.items())])


WRITERS = {".csv": write_csv, ".mat": write_mat, ".h5": write_h5, ".tdms": write_tdms}


@pytest.mark.parametrize("suffix", WRITERS)
def test_named_columns(bench, suffix):
    root, _, _, hit = bench
    write = WRITERS[suffix]
    good = root / f"good_hit{suffix}"
    write(good, columns(hit))
    code, out, err = call("modes", good, "--json", "--band-hz", 5, 110)
    assert code == 0, err
    assert len(json.loads(out)["modes"]) >= 2
    bad = root / f"bad_hit{suffix}"
    for what, table in bad_columns(hit).items():
        write(bad, table)
        answer = call("modes", bad, "--json", "--band-hz", 5, 110)
        expect_one_sentence(*answer, f"{suffix}: {what}", bad.name, "No modes")
    whole = good.read_bytes()
    for cut in (1, 100, len(whole) // 3, len(whole) // 2):
        bad.write_bytes(whole[:cut])
        code, out, err = call("modes", bad, "--json", "--band-hz", 5, 110)
        if suffix == ".csv" and code == 0:
            continue  # a text table cut between two rows is a whole, shorter record
        expect_one_sentence(code, out, err, f"{suffix} cut at {cut}", bad.name)


def test_configurations(bench):
    root, *_ = bench
    robot, plan = root / "robot" / "robot.toml", root / "plan" / "campaign.toml"
    good_robot, good_plan = robot.read_text(), plan.read_text()
    urdf = robot.parent / "arm.urdf"
    good_urdf = urdf.read_text()
    changes = [
        (robot, good_robot.replace('urdf = "arm.urdf"', 'urdf = "none.urdf"')),
        (robot, good_robot.replace('tcp_frame = "tool"', 'tcp_frame = "nose"')),
        (robot, good_robot.replace('joint = "joint_a1"', 'joint = "joint_9"')),
        (robot, good_robot.replace("stiffness = 60000.0", "stiffness = -1.0")),
        (robot, good_robot.replace("stiffness = 60000.0", 'stiffness = "high"')),
        (robot, good_robot.replace("damping = ", "dampening = ", 1)),
        (robot, good_robot.replace("axis = [0, 0, 1]", "axis = [0, 0, 3]")),
        (robot, good_robot.replace("axis = [0, 0, 1]", "axis = [0, 0]")),
        (robot, good_robot[: len(good_robot) // 2].rsplit("=", 1)[0]),
        (robot, good_robot.split("[[compliance]]")[0]),
        (robot, ""),
        (robot, "\x00\x01\x02"),
        (urdf, good_urdf[: len(good_urdf) // 2]),
        (urdf, "<mujoco/>"),
        (urdf, ""),
        (urdf, good_urdf.replace('type="revolute"', 'type="prismatic"', 1)),
        (urdf, good_urdf.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 one 0"/>', 1)),
        (plan, good_plan.replace("joints_deg", "angles")),
        (plan, good_plan.replace("[[-40, 40], ", "[")),
        (plan, good_plan.replace("[-40, 40]", "[-400, 40]")),
        (plan, good_plan.replace("[-40, 40]", "[40, -40]")),
        (plan, good_plan.replace("count = 4", "count = 0")),
        (plan, good_plan.replace("[5.0, 110.0]", "[110.0, 5.0]")),
        (plan, good_plan.replace("integrated_variance", "crystal_ball")),
        (plan, good_plan + "[surprise]\nx = 1\n"),
        (plan, ""),
    ]
    for i, (path, text) in enumerate(changes):
        kept = path.read_text()
        path.write_text(text)
        answer = call("new", root / f"bad{i}", "--robot", robot, "--campaign", plan, "--json")
        expect_one_sentence(*answer, f"{path.name} {i}")
        assert not (root / f"bad{i}").exists()
        path.write_text(kept)


def test_usage(bench):
    root, good, poses, _ = bench
    cell = root / "cell"
    for arguments in [
        ("next", root / "nowhere"),
        ("status", good),
        ("next", cell, "--count", "0"),
        ("next", cell, "--acquisition", "crystal_ball"),
        ("import", cell, root / "nowhere"),
        ("import", cell, good / "data", "--pose", "never proposed"),
        ("import", cell, good, "--pose", "G9", "--json", "--nonsense"),
        ("withdraw", cell, "P999"),
        ("skip", cell, "P999"),
        ("predict", cell, root / "nowhere.csv"),
        ("predict", cell, poses, "--out", root / "good" / "recordings.csv" / "x.npz"),
        ("replay", cell, "--until", "0"),
        ("modes", root / "nowhere.uff"),
        ("modes", poses),
        ("new", cell, "--robot", root / "robot" / "robot.toml"),
        ("frobnicate",),
    ]:
        expect_one_sentence(*call(*arguments), str(arguments[0]))


def test_huge_files_are_refused_without_reading_them(bench):
    root, *_ = bench
    for name, size in (("huge.uff", 2**30), ("huge.mat", 2**30), ("huge.csv", 2**30)):
        with open(root / name, "wb") as file:
            file.truncate(size)
        expect_one_sentence(*call("modes", root / name, "--json"), name, name, "No modes")
        expect_one_sentence(*call("import", root / "cell", root / name, "--pose", "G1"), name)
    expect_one_sentence(*call("predict", root / "cell", root / "huge.csv", "--json"), "huge table")
    assert sum(p.stat().st_size for p in (root / "cell").rglob("*") if p.is_file()) < 10**8


def test_damaged_log_exits_5(bench):
    root, *_ = bench
    cell = root / "damaged"
    shutil.copytree(root / "cell", cell)
    call("next", cell)
    log = cell / "log.jsonl"
    data = log.read_bytes()
    log.write_bytes(data[:40] + b"#" + data[41:])
    code, out, err = call("status", cell, "--json")
    assert (code, out) == (5, "")
    assert "line 1" in err
