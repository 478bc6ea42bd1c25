"""A whole run of hits in one universal file, and folders in folders."""

import json
import shutil
from pathlib import Path

from planner.recording.hits import hits_from
from planner.recording.read import hits_in, read
from tests.support.outside import call, make_cell, record


def joined(files: list[Path], target: Path) -> Path:
    """Universal files, one after the other in one."""
    target.write_bytes(b"".join(file.read_bytes() for file in files))
    return target


def test_a_run_of_hits_in_one_file_is_imported_hit_by_hit(tmp_path):
    robot, campaign_toml, truth = make_cell(tmp_path, learns=False)
    cell = tmp_path / "cell"
    assert call("new", cell, "--robot", robot, "--campaign", campaign_toml)[0] == 0
    pose = json.loads(call("next", cell, "--json")[1])["proposals"][0]
    folder = record(truth, tmp_path / "made", pose["pose"], pose["joints_deg"])
    files = sorted((folder / "data").iterdir())
    (tmp_path / "export" / "today").mkdir(parents=True)
    run = joined(files, tmp_path / "export" / "today" / "run.unv")
    assert hits_in(run) == (None,) * 9
    for hit, file in zip(hits_from(read(run)), files, strict=True):
        (alone,) = hits_from(read(file))
        assert hit.axis == alone.axis
        assert (hit.force_n == alone.force_n).all()
    code, out, err = call("import", cell, tmp_path / "export", "--json")
    assert code == 0, err
    together = json.loads(out)
    assert [Path(name).name for name in together["accepted"]] == [
        f"run.unv (hit {k})" for k in range(1, 10)
    ]
    assert together["remarks"] == []
    code, _, err = call("import", cell, run, "--pose", "P001", "--json")  # known, hit by hit
    assert code == 0, err
    assert call("replay", cell)[0] == 0
    other = tmp_path / "other"
    shutil.copytree(cell, other)
    assert call("undo", other)[0] == 0
    code, out, err = call("import", other, folder / "data", "--json")
    assert code == 0, err
    alone = json.loads(out)
    assert [m["frequency_hz"] for m in alone["modes"]] == [
        m["frequency_hz"] for m in together["modes"]
    ]


def test_hits_along_one_axis_or_a_single_hit_are_remarked_upon(tmp_path):
    robot, campaign_toml, truth = make_cell(tmp_path, learns=False)
    cell = tmp_path / "cell"
    assert call("new", cell, "--robot", robot, "--campaign", campaign_toml)[0] == 0
    pose = json.loads(call("next", cell, "--json")[1])["proposals"][0]
    folder = record(truth, tmp_path / "made", pose["pose"], pose["joints_deg"])
    code, out, err = call("import", cell, folder / "data" / "P001_px_1.uff", "--json")
    assert code == 0, err
    said = " ".join(json.loads(out)["remarks"])
    assert "no accepted hit along y and z" in said
    assert "only one accepted hit along x" in said
