"""The page of a pose is never higher than the screen, and says whole what is to be done.

And what a session knows beside the campaign, as values.
"""

import io
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from rich.text import Text

from planner.campaign.events import HitRecord, Proposal
from planner.design.stopping import Forecast
from planner.recording.joints import JointUnits
from planner.session.hit_verdicts import HitVerdict
from planner.session.pose_screen import PosePage, keys_that_do, page_with_hits, remedy_first
from planner.session.screen import Screen
from planner.session.session_state import SessionState
from planner.session.session_text import HELP, refusals
from planner.words import short_name


def judged(number: int, axis: str, kind: str, text: str) -> HitVerdict:
    return HitVerdict(Path("hit.uff"), axis, kind, text, number=number)


DOUBLE = judged(
    1, "+x", "repeat",
    "A second pulse of 120 N follows the first of 300 N; hit once and let it bounce off.",
)  # fmt: skip
AGAINST = judged(
    2, "-x", "good",
    "The driving-point FRF of hits along -x has the wrong sign (imaginary part of "
    "acceleration/force below 0 along x): check the sign of the axis and the polarity of force and "
    "acceleration.",
)  # fmt: skip
CLIPPED = judged(
    3, "", "repeat",
    "The force is clipped at 312.5 N (3 samples); raise the range of force or hit more softly. The "
    "acceleration x is clipped at 5.1 m/s² (4 samples); raise the range of acceleration x or hit "
    "more softly.",
)  # fmt: skip
LATE = judged(4, "+z", "late", "answers as P001 did: [b] it is from there, [h] from here")
OTHER = judged(
    5, "+z", "repeat",
    "Its FRF is that of hits along x (correlation 0.12, others 0.99); check axis and hit point, "
    "and hit again.",
)  # fmt: skip
ALL = DOUBLE, AGAINST, CLIPPED, LATE, OTHER
KEYS = keys_that_do([(key, f"does {key} to what waits there", True) for key in "arbhsku"])
FOREIGN = "foreign.uff is no UFF file: it begins with other words than one; export it again."


@pytest.fixture
def page():
    """Seven joints, one of them a rail; six modes; names as long as people give."""
    names = ("rail", *(f"joint_{i}" for i in range(1, 7)))
    place = (1200.0, 10.0, -30.0, 45.0, 90.0, 12.5, -170.0)
    reason = "the model knows least there, and the frequencies of modes 3 and 4 cross nearby"
    name = "left-of-the-fixture-station-12-once-more"
    return PosePage(
        Proposal(name, place, (1.234, -0.5, 1.6), None, reason), 17,
        JointUnits(names, (True, *[False] * 6)), "tool0_hammer_tip", 4, (),
        (8.12, 12.5, 17.8, 22.3, 28.9, 33.1), (0.12, 0.2, 0.3, 0.4, 0.5, 0.6),
        Path("/home/someone/projects/2026/cell7/measurements/exports/analyser-3"),
        unfinished=(("foreign.uff", FOREIGN), ("half.uff", "half.uff is still being written")),
        progress="frequency sd over the workspace 1.23 %; 2.3 min per pose; what lacks: a pose",
        keys=KEYS,
    )  # fmt: skip


def lines(page, width=80, height=22):
    console = Console(width=width)
    with console.capture() as captured:
        console.print(page.page(width, height))
    return captured.get().rstrip("\n").split("\n")


def whole(found):
    return " ".join(" ".join(found).split())


@pytest.mark.parametrize(("last", "files"), [(1, 2), (2, 0), (3, 2), (4, 0), (5, 2)])
def test_the_last_verdict_is_whole_and_the_page_fits(page, last, files):
    found = lines(replace(page, hits=ALL[:last], unfinished=page.unfinished[:files]))
    assert len(found) <= 22
    assert all(len(line) <= 80 for line in found)
    text = whole(found)
    do, why = remedy_first(ALL[last - 1].text)
    assert f"{do} {why}".strip() in text
    assert all(key in text for key in whole([KEYS]).split("  "))
    cut = [line for line in found if "…" in line]
    assert all(line.startswith("waiting for hits in") for line in cut)


def test_what_to_do_comes_first(page):
    assert remedy_first(DOUBLE.text) == (
        "Hit once and let it bounce off.", "A second pulse of 120 N follows the first of 300 N."
    )  # fmt: skip
    do, why = remedy_first(CLIPPED.text)
    force = "Raise the range of force or hit more softly."
    assert do == f"{force} Raise the range of acceleration x or hit more softly."
    assert why == "The force is clipped at 312.5 N (3 samples). The acceleration x is clipped at " \
        "5.1 m/s² (4 samples)."  # fmt: skip
    assert remedy_first(LATE.text) == (LATE.text, "")
    said = whole(lines(replace(page, hits=(CLIPPED,))))
    assert f"REPEAT HIT 3 (axis not stated): {force} Raise the range of acceleration x" in said
    assert "cannot be used: foreign.uff: Export it again." in said
    assert "not whole yet: half.uff is still being written" in said


def test_with_room_all_is_said(page):
    found = lines(replace(page, hits=ALL), height=60)
    text = whole(found)
    assert all(" ".join(remedy_first(hit.text)).strip() in text for hit in ALL[-4:])
    assert page.proposal.reason in text
    assert str(page.folder) in text
    assert "33.10 ± 0.60" in text
    assert page.progress in text
    assert not any("…" in line for line in found)


def test_a_result_higher_than_the_screen_stands_once_above_the_next_page():
    drawn = io.StringIO()
    console = Console(file=drawn, width=80, height=24, force_terminal=True, legacy_windows=False)
    screen = Screen(console)
    result, note = Text("\n".join(f"result {i}" for i in range(40))), Text("The last one refused.")
    screen.show(Text("page"))
    screen.leave(result, [note])
    screen.say(Text("One more."))
    screen.show(Text("page"))
    screen.say(Text("And one."))
    text = drawn.getvalue()
    assert text.count("result 39") == 1
    wiped = text.split("\x1b[2J")
    assert wiped[2].count("\n") >= 40 + 23  # pushed off the screen, not wiped off
    assert all(said in wiped[-1] for said in (note.plain, "One more.", "And one."))
    assert all(len(part.split("\n")) <= 24 for part in wiped[3:])


def test_names_of_files_leave_room_for_what_is_said_of_them(page):
    name = "measurement_2026-11-24_cell7_left_station_hit_x_003.uff"
    said = f"disagrees with hit 2 ({name}) (correlation 0.42): hit along x once more"
    verdict = HitVerdict(Path("exports") / name, "+x", "unsure", said, number=1)
    why = f"exports/{name} holds no force; export it again."
    made = page_with_hits(page, [verdict], [(verdict.path, why)], (True, False), False, "")
    text = whole(lines(made, height=40))
    assert name not in text
    assert "disagrees with hit 2 (measurem…n_hit_x_003.uff) (correlation 0.42)" in text
    assert "cannot be used: measurem…n_hit_x_003.uff: Export it again." in text
    assert short_name("exports/P001_x_1.uff") == "P001_x_1.uff"
    refused = HitRecord(name, "", "", reason="A second pulse follows; hit once.")
    lying = SimpleNamespace(refused=[refused] * 6)
    told = refusals(lying).split("\n")
    assert told[:2] == ["refused measurem…n_hit_x_003.uff: Hit once."] * 2
    assert told[-1] == "and 2 more: planner status"
    assert "A second pulse follows." in refusals(SimpleNamespace(refused=[refused]))


def under_a_full_page(page, *said):
    """What the screen shows after the last of the texts that were said."""
    console = Console(width=80, height=24, force_terminal=True, legacy_windows=False)
    screen = Screen(console)
    with console.capture():
        screen.show(replace(page, hits=ALL).page)
    for text in said:
        with console.capture() as captured:
            screen.say(Text(text))
    shown = Text.from_ansi(captured.get().split("\x1b[2J")[-1]).plain
    assert shown.rstrip("\n").count("\n") < 24
    return shown


def test_a_sentence_under_a_full_page_is_seen(page):
    told = "Hits are missing (x 1/4, y 0/4, z 0/4): hit on, or press a again to accept it as it is."
    shown = whole(under_a_full_page(page, "An earlier sentence.", told).split("\n"))
    assert told in shown
    assert " ".join(remedy_first(OTHER.text)) in shown


def test_help_is_seen_where_the_page_is_full(page):
    shown = under_a_full_page(page, HELP)
    assert all(line in shown for line in HELP.split("\n"))
    assert "any key" in shown
    assert "go to pose" in under_a_full_page(page, HELP, "One more.")


def test_hits_without_an_axis_are_told_once_and_leave_the_page_its_head(page):
    text = "tap.csv states no axis; begin the file with a line such as '# hit: +x'."
    hits = tuple(judged(number, "", "unstated", text) for number in range(1, 10))
    found = lines(replace(page, hits=hits))
    assert len(found) <= 22
    assert "go to pose" in found[0]
    assert whole(found).count("along which axis?") == 1
    assert "9 without an axis" in whole(found)


def model(sd_percent: float, done: bool = False) -> Any:
    stop = SimpleNamespace(frequency_sd_percent=1.0, measurements_min=3, measurements_max=9)
    cell = SimpleNamespace(config=SimpleNamespace(stop=stop))
    return SimpleNamespace(
        cell=cell, done=done, frequency_sd_percent=np.full(2, sd_percent),
        waits_for="" if done else "2 more poses", forecast=Forecast(1, 2, 0.95, 1, 0.3, 1, 0.4, 2),
    )  # fmt: skip


def state(*poses: str) -> Any:
    return SimpleNamespace(used=poses, measurements=dict.fromkeys(poses))


def test_an_import_that_was_taken_back_no_longer_counts():
    once = SessionState().after("P1", model(0.5), state("P1"), 60.0, auto=False)
    wanted = (
        "frequency sd over the workspace 0.50 %; 1.0 min per pose; what lacks: 2 more poses. One "
    )
    assert once.progress == f"{wanted}more pose should bring the RMSE to about 0.60 %."
    undone = once.undone(state())
    assert (undone.measured, undone.progress) == ((), "")
    again = undone.after("P1", model(0.5), state("P1"), 60.0, auto=False)
    assert again.measured == ("P1",)
    assert again.progress == once.progress


def test_a_session_that_reaches_the_target_says_so_and_ends_by_itself():
    resumed = SessionState().after(
        "P4", model(0.5, done=True), state("P1", "P2", "P3", "P4"), 60.0, True
    )
    assert resumed.progress.endswith("; target reached")
    assert resumed.stop == "target reached"
    assert resumed.announced


def test_a_session_ends_where_campaign_toml_allows_no_more():
    full = state(*(f"P{k}" for k in range(9)))
    course = SessionState().after("P8", model(5.0), full, 60.0, auto=False)
    assert course.stop == "as many measurements as campaign.toml allows"
    assert not course.announced
