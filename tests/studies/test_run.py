"""`planner study all`: pages, tables of claims, and nothing that is finished runs again."""

import csv
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

from planner.errors import InputError
from planner.progress import no_progress
from planner.report.plot_marks import empty
from planner.studies import registry
from planner.studies import run as conduct
from planner.studies.claims import Bound, ClaimRule
from planner.studies.report import Paper, Report, StudyAnswer, Table

AUTHORS = {"busch2022": "Busch, Zaeh", "lei2023": "Lei, Hou, Ding"}
RULES = (
    ClaimRule("It is <so>.", Bound("a", above=0.4)),
    ClaimRule("It is not.", Bound("b", above=0.4, full=0.5)),
    ClaimRule("Ours is better.", Bound("c", below=1, full=0.5), ours=True),
    ClaimRule("Nobody knows.", Bound("d", above=0)),
)


@pytest.fixture
def ran(monkeypatch):
    """Two quick studies stand for all; what ran, in order."""
    ran = []

    def load(name):
        def study(progress, small):
            ran.append((name, small))
            progress("all of it", 0.5)
            values = [{"a": 0.5, "b": 0.5, "c": 0.7}, {"a": 0.6, "b": 0.4}]
            notes = {"b": "the data are too few: 3"}
            table = Table(f"{name}_t", "T", ("a", "b"), (("x", float("nan")), ("y", 2.5)))
            figures = {f"{name}_f": empty((3, 2), "empty")}
            return Report("SIMULATED: nothing", (table,), values, notes, figures)

        return SimpleNamespace(study=study, RULES=RULES, PAPER=Paper(AUTHORS[name], 2023, "T", "J"))

    monkeypatch.setattr(registry, "NAMES", ("busch2022", "lei2023"))
    monkeypatch.setattr(registry, "load", load)
    return ran


def test_all_studies_leave_an_index_a_page_each_and_one_table_of_claims(ran, tmp_path):
    told = conduct.run_all(tmp_path, False, no_progress)
    assert ran == [("busch2022", False), ("lei2023", False)]
    assert told.taken == ()
    index = (tmp_path / "index.html").read_text()
    for name, authors in AUTHORS.items():
        page = (tmp_path / name / f"{name}.html").read_text()
        assert f'href="{name}/{name}.html"' in index
        assert authors in index
        assert authors in page
        assert "It is &lt;so&gt;." in page
        assert "the data are too few: 3" in page
        assert "data:image/png;base64," in page
        # Self-contained: nothing is loaded from elsewhere.
        assert not re.search(r'(src|href)="(?!data:)', page)
    with (tmp_path / "claims.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    verdicts = ["holds", "does not hold", "holds in kind", "not testable here"]
    assert [row["verdict"] for row in rows] == 2 * verdicts
    assert all(row["reason"] for row in rows)
    assert rows[1]["reason"] == "no: 0.4 on the worst seed is ≤ 0.4; the data are too few: 3"
    assert rows[2]["claim"] == "(this program) Ours is better."
    assert "Of 4 claims: holds 1, holds in kind 1, does not hold 1, not testable here 1." in page


def interrupted(folder):
    (folder / "lei2023" / "study.json").unlink()


def damaged(folder):
    file = folder / "lei2023" / "study.json"
    file.write_bytes(file.read_bytes().replace(b"2.5", b"2.6"))


def without_a_picture(folder):
    next((folder / "lei2023").glob("*.png")).unlink()


@pytest.mark.parametrize("spoil", [interrupted, damaged, without_a_picture])
def test_what_is_finished_is_not_run_again(ran, tmp_path, spoil):
    first = conduct.run_all(tmp_path, True, no_progress)
    spoil(tmp_path)
    ran.clear()
    second = conduct.run_all(tmp_path, True, no_progress)
    assert ran == [("lei2023", True)]
    assert second.taken == ("busch2022",)
    assert second.damaged == (("lei2023",) if spoil is damaged else ())
    assert first.studies[0].to_json() == second.studies[0].to_json()
    ran.clear()
    conduct.run_all(tmp_path, False, no_progress)  # a small version is no full one
    assert ran == [("busch2022", False), ("lei2023", False)]


def test_all_needs_a_folder(ran):
    with pytest.raises(InputError, match="name a folder with --out"):
        conduct.run_all(None, True, no_progress)
    assert not ran


def test_an_answer_survives_its_json(ran):
    answer = conduct.run_study("lei2023", None, True, no_progress)
    again = StudyAnswer.from_json(answer.to_json())
    assert again.findings == answer.findings
    assert again.to_json() == answer.to_json()
    assert again.tables[0].rows[0][1] != again.tables[0].rows[0][1]  # NaN
    assert isinstance(again.files, list)
    assert not any(Path(file).exists() for file in again.files)
