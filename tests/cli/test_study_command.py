"""`planner study`: answers, files, and one sentence for bad input."""

from pathlib import Path

import pytest

from tests.support.outside import answer, planner


@pytest.mark.parametrize("arguments", [("seed-9",), ("seyedhosseini2025", "--out", "{file}")])
def test_bad_input_is_one_sentence(tmp_path, arguments):
    file = tmp_path / "file"
    file.write_text("")
    done = planner("study", *(a.format(file=file) for a in arguments), check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1
    assert "choose one of busch2022" in done.stderr or "name another folder" in done.stderr


@pytest.mark.slow
def test_a_study_answers_in_json_and_writes_its_tables_and_pictures(tmp_path):
    told = answer("study", "seyedhosseini2025", "--out", tmp_path / "out")
    assert told["study"] == "seyedhosseini2025"
    assert told["data"].startswith("SIMULATED")
    tables = {t["name"] for t in told["tables"]}
    assert tables >= {f"{told['study']}_errors", f"{told['study']}_correlation"}
    assert all({"paper", "here", "holds"} <= set(f) for f in told["findings"])
    assert len([f for f in told["files"] if f.endswith(".png")]) == 3
    assert all(Path(f).is_absolute() and Path(f).stat().st_size > 0 for f in told["files"])
