"""A line never ends between a number and its sd or unit; small sds keep their digits."""

import io
from dataclasses import dataclass

import numpy as np
import pytest
from rich.console import Group
from rich.panel import Panel
from rich.text import Text

from planner.cli.answer import respond
from planner.report.answer import Answer, RefusedFile
from planner.report.console import STAND_IN, UnbrokenConsole
from planner.report.imports import PoseImport
from planner.report.text import table
from planner.words import significant

SAID = (
    "Your x hits land 4 ± 1 mm towards +y and mode 3 at 13.482 ± <0.001 Hz, damping 2.05 %, is "
    "found again; joint_2 has 1.3e+06 ± 4e+04 N·m/rad and answers 30 times."
)
WHOLE = ("4 ± 1 mm", "mode 3", "13.482 ± <0.001 Hz", "2.05 %", "1.3e+06 ± 4e+04 N·m/rad")


@dataclass(frozen=True)
class Told(Answer):
    def text(self):
        return Group(Text(SAID), Panel(Text(SAID)))


@pytest.mark.parametrize("width", range(30, 90))
def test_a_number_and_what_goes_with_it_stay_on_one_line(width, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(width))
    respond(Told(), as_json=False)
    lines = capsys.readouterr().out.splitlines()
    assert all(len(line) <= width for line in lines)
    assert not any(STAND_IN in line for line in lines)
    for what in WHOLE:
        assert sum(line.count(what) for line in lines) == 2, what


def test_where_the_line_is_too_short_it_breaks_as_it_can():
    drawn = io.StringIO()
    console = UnbrokenConsole(file=drawn, width=16)
    made = table("", "of a mode", "frequency (Hz)")
    made.add_row("13.482 ± 0.001", "13.482 ± 0.001")
    console.print(made)
    console.print(Text("is 1.3e+06 ± 4e+04 N·m/rad"))
    assert STAND_IN not in drawn.getvalue()
    assert "is 1.3e+06 ± \n4e+04 N·m/rad" in drawn.getvalue()


@pytest.mark.parametrize(
    ("value", "said"),
    [(0.01234, "0.012"), (0.00949, "0.0095"), (1.0, "1.0"), (24.1, "24"), (123.4, "120"), (0, "0"),
     (0.0996, "0.10"), (float("inf"), "inf")],
)  # fmt: skip
def test_a_small_number_keeps_its_digits(value, said):
    assert significant(value) == said


def test_an_import_says_how_a_small_sd_changed():
    before, after = np.array([0.0123, 1.26]), np.array([0.0091, 0.84])
    refused = (RefusedFile("x.uff", "A second pulse."),)
    done = PoseImport("P001", ("y.uff",), refused, (), (), 0.5, before, after, (), None, False)
    drawn = io.StringIO()
    UnbrokenConsole(file=drawn, width=100).print(Group(*done.parts()))
    assert "sd of frequencies: 0.012 → 0.0091 %, 1.3 → 0.84 %" in drawn.getvalue()
