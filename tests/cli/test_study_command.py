"""`planner study`: answers, files, and one sentence for bad input."""

from pathlib import Path

import pytest

from tests.support.outside import call, told


@pytest.mark.parametrize("arguments", [("seed-9",), ("seyedhosseini2025", "--out", "{file}")])
def test_bad_input_is_one_sentence(tmp_path, arguments):
    file = tmp_path / "file"
    file.write_text("")
    code, out, err = call("study", *(a.format(file=file) for a in arguments))
    assert (code, out, len(err.strip().splitlines())) == (2, "", 1)
    assert "choose one of busch2022" in err or "name another folder" in err


@pytest.mark.slow
def test_a_study_answers_in_json_and_writes_its_tables_and_pictures(tmp_path):
    answer = told("study", "seyedhosseini2025", "--out", tmp_path / "out")
    assert answer["study"] == "seyedhosseini2025"
    assert answer["data"].startswith("SIMULATED")
    tables = {t["name"] for t in answer["tables"]}
    assert tables >= {f"{answer['study']}_errors", f"{answer['study']}_correlation"}
    assert all({"paper", "here", "holds"} <= set(f) for f in answer["findings"])
    assert len([f for f in answer["files"] if f.endswith(".png")]) == 3
    assert all(Path(f).is_absolute() and Path(f).stat().st_size > 0 for f in answer["files"])
