"""JSON and text of answers: what every one of them has in common; and progress until then."""

import json
import time
from dataclasses import dataclass, field

import msgspec
import numpy as np
import pytest
from rich.text import Text

from planner.cli import answer
from planner.report.answer import NOT_IN_JSON, Answer, encoded


@dataclass(frozen=True)
class Part:
    value: float


@dataclass(frozen=True)
class Whole(Answer):
    numbers: np.ndarray
    parts: tuple[Part, ...]
    shape: complex
    left_out: int | msgspec.UnsetType = msgspec.UNSET
    fits: object = field(default=None, metadata=NOT_IN_JSON)


def test_an_answer_is_json_that_every_reader_takes():
    whole = Whole(np.array([1.0, np.nan, np.inf]), (Part(float("nan")), Part(2.0)), 1 + 2j, fits=1)
    told = json.loads(encoded(whole))
    assert told == {
        "numbers": [1.0, None, None],
        "parts": [{"value": None}, {"value": 2.0}],
        "shape": [1.0, 2.0],
    }
    assert whole.to_json() == told
    assert whole.text() is None


def test_a_notebook_shows_what_the_screen_does():
    @dataclass(frozen=True)
    class Told(Answer):
        def text(self):
            return Text("mode 1 at 8.1 Hz", style="bold")

    shown = Told()._repr_html_()
    assert "8.1" in shown
    assert "font-weight: bold" in shown


def test_a_key_appears_once_it_is_set():
    assert Whole(np.zeros(0), (), 0j, left_out=3).to_json()["left_out"] == 3


@pytest.mark.parametrize("quiet", [False, True])
def test_long_work_is_told_in_lines_where_nobody_looks_at_a_terminal(quiet, monkeypatch, capsys):
    monkeypatch.setattr(answer, "FIRST_S", 0.02)
    with answer.progress_bar("comparing", quiet) as tell:
        tell("runs", 0.25)
        time.sleep(0.3)
    said = capsys.readouterr()
    assert said.out == ""
    assert ("comparing: runs, 25 % (0 s)" in said.err) == (not quiet)
