"""The terminal session: what it shows, what its keys do, and what it survives."""

import os
import re
import shutil
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from planner.campaign.campaign import Campaign
from planner.dataset.screened_files import Source
from planner.errors import InputError
from planner.proof.hits import simulate_hit
from planner.proof.recordings import write_uff
from planner.recording.folder import TABLE
from planner.replay import replay
from planner.report.rerun.campaign import RerunView
from planner.session.diagnosis_process import DiagnosisProcess, diagnose_measured
from planner.session.session_state import RerunQueue
from tests.support.hit_files import write_hit
from tests.support.outside import FROZEN, HAMMER, record
from tests.support.rerun_columns import entities_of

SIX = ("+x", "+x", "+y", "+y", "+z", "+z")
WANTED = (
    "joint_a1", "angle (°)", "expected (Hz)", "damping (%)", "tool at x", "measured (Hz)",
    "off by (sd)", "sd of predicted frequencies", "target 1 %", "min per pose", "SIMULATED",
)  # fmt: skip


def test_a_session_shows_imports_and_goes_on(cell, deliver, session):
    campaign, _, inbox = cell
    analyser = threading.Thread(target=deliver, args=(campaign.next()[0],))
    analyser.start()
    played = session(
        campaign, inbox,
        ("all hits are in", "?"), ("refuse bad hits, or all", "s"), ("★", "a"),
        ("Pose P001: 9 hits in", "k"), ("in the way?", "\n"), ("not be offered", "u"),
        ("Undone: ", "q"),
        limit_s=60, quiet_s=0.15,
    )  # fmt: skip
    analyser.join()
    assert (played.summary.stopped, played.summary.measured) == ("quit", ("P001",))
    assert [wanted for wanted in WANTED if wanted not in played.text] == []
    assert max(len(line) for line in played.text.splitlines()) <= 100
    assert campaign.state.starred == {"P001"}
    assert not campaign.state.skipped


def test_resume_ignores_what_was_imported_and_waits_for_torn_files(cell, deliver, session):
    campaign, _, inbox = cell
    deliver(campaign.next()[0])
    assert session(campaign, inbox, until="go to pose P002").summary.measured == ("P001",)
    again = Campaign(campaign.directory)
    deliver(again.next()[0], 1, torn=True)
    second = session(again, inbox, limit_s=2)
    assert (second.summary.measured, second.summary.stopped) == ((), "time limit")
    assert "not whole yet" in second.text
    assert list(again.state.measurements) == ["P001"]


def test_refused_hits_are_not_offered_again_even_by_the_next_session(cell, deliver, session):
    campaign, _, inbox = cell
    deliver(campaign.next()[0])
    keys = [("all hits are in", "r"), ("No hit is bad", "r"), ("9 hits refused (1, 2, 3", "a"),
            ("Nothing to import yet", "q")]  # fmt: skip
    session(campaign, inbox, *keys)
    assert campaign.state.measurements == {}
    again = Campaign(campaign.directory)
    assert len(again.state.refused) == 9
    assert session(again, inbox, limit_s=1).summary.measured == ()
    assert again.state.measurements == {}
    # Taken back, they wait again, at the same pose.
    session(again, inbox, ("[u] undo", "u"), ("all hits are in", "a"), ("P001: 9 hits in", "q"))
    assert list(again.state.measurements) == ["P001"]
    assert again.state.refused == {}


@pytest.mark.parametrize(
    ("key", "said", "used", "refused"),
    [("a", "1 hit refused (", 5, 1), ("h", "are used, as you said", 6, 0)],
)  # fmt: skip
def test_a_hit_along_another_axis_than_said_is_asked_about(cell, session, key, said, used, refused):
    campaign, truth, inbox = cell
    q, rng = np.deg2rad(campaign.next()[0].joints_deg), np.random.default_rng(3)
    for number, (axis, stated) in enumerate(zip([*SIX[:5], "+y"], SIX, strict=True)):
        hit = simulate_hit(truth, q, axis, HAMMER, rng)
        hit = type(hit)(stated, hit.force_n, hit.acceleration_m_s2)
        write_uff(inbox / f"h{number}.uff", hit, HAMMER)
    keys = [("right?", key), ("z  ", "a")]
    keys += [] if key == "h" else [("Hits are missing", "a")]
    assert said in session(campaign, inbox, *keys, (said, "q"), hits=6, limit_s=60).flat
    (measured,) = campaign.state.used
    assert len(measured.accepted) == used
    reasons = [hit.reason for _, hit in campaign.state.refused.values()]
    assert len(reasons) == refused
    assert all("disagrees with hit" in r and "refused by the engineer" in r for r in reasons)


@pytest.fixture
def misplaced(measured, tmp_path):
    """A campaign of two poses, and a proposal at which the hits of another pose arrive."""
    campaign, truth, inbox = measured
    stated, true = campaign.next(2)
    made = record(truth, tmp_path / "made", stated.pose, list(true.joints_deg), 9)
    shutil.copytree(made / "data", inbox, dirs_exist_ok=True)
    return campaign, inbox, stated.pose, true.pose


def test_held_hits_are_moved_to_where_they_fit_and_that_is_taken_back(misplaced):
    campaign, inbox, stated, true = misplaced
    (report,) = campaign.import_paths((inbox,), stated)
    assert report.question is not None
    assert report.question.fits == true
    assert stated not in campaign.state.open
    with pytest.raises(InputError, match="No joint angles"):
        campaign.move(stated, "nowhere")
    assert stated in campaign.state.held
    moved = campaign.move(stated, true)
    assert (moved.question, len(moved.accepted)) == (None, 9)
    assert not campaign.state.held
    assert true in campaign.state.measurements
    for act in (lambda: None, lambda: campaign.withdraw(stated)):
        act()
        campaign.undo()
        assert campaign.state.held[stated].question == report.question
        assert true not in campaign.state.measurements


def test_without_anybody_to_ask_hits_of_another_pose_are_held(misplaced, session):
    campaign, inbox, stated, true = misplaced
    played = session(campaign, inbox, until=f"go to pose {true}")
    asked = campaign.state.held[stated].question
    assert asked is not None
    assert asked.fits == true
    assert (played.summary.questions, played.summary.measured) == ({stated: asked.text}, ())
    assert f"Held back, not used: {asked.text}" in played.flat
    assert f"go to pose {true}" in played.flat
    assert len(campaign.state.used) == 2


@pytest.mark.parametrize(("key", "said"), [("a", "are used"), ("o", "9 hits in")])
def test_the_question_survives_the_session_and_is_answered_by_a_key(misplaced, session, key, said):
    campaign, inbox, stated, true = misplaced
    first = session(campaign, inbox, ("all hits are in", "a"), ("Is the robot at", "q"))
    assert list(first.summary.questions) == [stated]
    assert len(campaign.state.used) == 2
    if key == "a":  # what fits make of such hits is not asked here, and takes long
        decided = campaign.directory / "campaign.toml"
        decided.write_text(decided.read_text() + FROZEN)
    again = Campaign(campaign.directory)
    second = session(again, inbox, ("Is the robot at", key), (said, "q"))
    assert second.summary.questions == {}
    assert [m.pose for m in again.state.used][2:] == [true if key == "o" else stated]
    assert (again.state.refused, again.state.held) == ({}, {})


def test_a_table_of_recordings_in_a_subfolder_gives_the_readback(
    cell, first_pose, session, tmp_path
):
    campaign, _, inbox = cell
    shutil.copytree(first_pose.made, inbox / "left_station" / first_pose.pose)
    rrd = tmp_path / "session.rrd"
    for _ in range(2):  # the second session resumes, and its recording tells it all
        session(campaign, inbox, until="go to pose P002", rrd=rrd)
    drawn = {"/note", "/frf/xx/0/measured", "/cell/measured", "/cell/proposed"}
    assert drawn <= entities_of(rrd)
    (measured,) = campaign.state.used
    assert 0 < np.max(np.abs(np.subtract(measured.joints_deg, first_pose.joints_deg))) <= 0.011
    assert {hit.repeat for hit in measured.accepted} == {1, 2, 3}


def test_files_that_do_not_say_their_axis_wait_for_the_table(cell, first_pose, session):
    """The table is written while the session runs; nothing is called a bad hit."""
    campaign, _, inbox = cell
    table = (first_pose.made / TABLE).read_text().replace("data/", "").replace(".uff", ".csv")
    for path in first_pose.files:
        (hit,), _ = Source(path, path.name).read()
        write_hit(inbox / f"{path.stem}.csv", hit, stated=False)

    def ask(text):
        return "9 without an axis" in text and bool((inbox / TABLE).write_text(table))

    keys = (ask, "s"), ("all hits are in", "a"), ("P001: 9 hits in", "q")
    text = session(campaign, inbox, *keys).text
    assert "along which axis? " in text
    assert '"# hit: +x"' in text
    assert "REPEAT HIT" not in text
    assert len(campaign.state.used[0].accepted) == 9


def test_undo_after_an_interrupted_import_takes_it_back_with_its_proposal(
    cell, deliver, session, monkeypatch
):
    """What the import gave was never on the screen: the next session begins with it."""
    campaign, _, inbox = cell
    proposal = campaign.next()[0]
    deliver(proposal)

    def interrupt(queue, reports=()):
        if reports:
            raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(RerunQueue, "note", interrupt)  # right after the import
        stopped = session(campaign, inbox, ("all hits are in", "a"))
    assert "imported 9 of 9 hits at P001: that is in the log; planner undo" in stopped.flat
    told = session(Campaign(campaign.directory), inbox, ("go to pose P002", "q")).flat
    assert re.search(r"The last import, P001: [\d.]+ Hz \(expected [\d.]+, .* sd\)", told)
    taken = Campaign(campaign.directory).undo(decisions_only=True)  # as the session's own key does
    assert [type(e.event).__name__ for e in taken] == ["Imported", "Proposed"]
    again = Campaign(campaign.directory)
    assert again.state.measurements == {}
    assert again.next()[0] == proposal
    assert all(step.check in ("identical", "kept") for step in replay(again))


def test_a_skip_asks_for_its_reason_and_typing_runs_no_command(cell, session):
    campaign, _, inbox = cell
    keys = [("go to pose P001", "k"), ("in the way?", "q"), (" q_", "\x7f")]
    keys += [("", letter) for letter in "husk"] + [(" husk_", "\n")]
    played = session(campaign, inbox, *keys, ("P001 and poses around it will not", "q"))
    assert played.summary.stopped == "quit"
    assert campaign.state.skipped == {"P001": "husk"}
    assert campaign.state.avoided == {"P001"}


def test_as_many_hits_make_a_pose_as_the_campaign_file_says(cell, deliver, session):
    campaign, _, inbox = cell
    decided = campaign.directory / "campaign.toml"
    decided.write_text(decided.read_text() + "\n[cost]\nhits_per_axis = 3\n")
    campaign = Campaign(campaign.directory)
    deliver(campaign.next()[0])
    assert "x  3/3" in session(campaign, inbox, ("all hits are in", "q"), hits=None).text


@pytest.mark.parametrize("interrupted", [False, True])
def test_pictures_wait_for_the_next_page_and_are_made_at_the_end_where_interrupted(
    cell, deliver, session, monkeypatch, interrupted
):
    campaign, _, inbox = cell
    deliver(campaign.next()[0])
    told = []

    def tell(story, entry, model, measured=None):
        if not model.labelled:  # what was before the session
            return
        shown = "Measurement 2: go to pose P002" in session.console.export_text(clear=False)
        told.append((type(entry.event).__name__, len(model.labelled), shown, measured is not None))
        if interrupted and len(told) == 1:
            raise KeyboardInterrupt

    monkeypatch.setattr(RerunView, "log", tell)
    rrd = inbox.parent / "told.rrd"
    session(campaign, inbox, until=lambda text: len(told) == 2, rrd=rrd)
    assert told[interrupted:] == [("Imported", 1, True, True), ("Proposed", 1, True, False)]


def test_the_diagnosis_runs_beside_the_session_and_is_said_when_it_is_through(
    cell, deliver, session, monkeypatch
):
    """What it runs is a stand-in: what a diagnosis finds is tested where it is made."""

    def diagnose(directory):
        from types import SimpleNamespace

        from planner.campaign.campaign import Campaign

        if len(Campaign(directory).state.used) == 1:
            return SimpleNamespace(verdict="consistent", findings=[])
        finding = SimpleNamespace(text="The floor gives way.")
        return SimpleNamespace(verdict="explained", findings=[finding])

    campaign, _, inbox = cell
    monkeypatch.setattr("planner.session.diagnosis_process.diagnose_measured", diagnose)
    monkeypatch.setattr("planner.session.key_commands.LEAST", 1)
    said = ""
    for number in range(2):
        deliver(campaign.next()[0], number)
        said += session(campaign, inbox, until="Diagnosis: ", explain=True).flat
    assert "Diagnosis: The simulation, once refitted, explains the recordings" in said
    assert "Diagnosis: The floor gives way." in said


@pytest.fixture
def beside(tmp_path, monkeypatch):
    """A diagnosis beside a session, and what replaces the diagnosis itself."""
    process = DiagnosisProcess(tmp_path)
    where = "planner.session.diagnosis_process.diagnose_measured"
    yield process, lambda made: monkeypatch.setattr(where, made)
    process.close()


def test_a_diagnosis_that_was_asked_for_meanwhile_follows_and_says_only_what_is_new(beside):
    process, runs = beside
    found = SimpleNamespace(verdict="unexplained", findings=[SimpleNamespace(text="At 20 Hz.")])
    runs(lambda directory: found)
    assert process.answer() is None
    process.ask()
    process.ask()
    assert (process.answer(wait=True) or "").endswith("At 20 Hz.")
    process.ask()
    assert process.answer(wait=True) is None  # nothing new
    process.ask()
    process.close()
    assert process.answer() is None


def test_a_diagnosis_goes_at_low_priority_and_ends_with_the_session(beside, tmp_path):
    process, runs = beside
    note = tmp_path / "note"

    def endless(directory):
        import os
        import time

        note.with_suffix(".part").write_text(f"{os.getpid()} {os.getpriority(os.PRIO_PROCESS, 0)}")
        note.with_suffix(".part").rename(note)
        time.sleep(600)

    runs(endless)
    process.ask()
    while not note.is_file():
        time.sleep(0.05)
    number, priority = map(int, note.read_text().split())
    assert priority > os.getpriority(os.PRIO_PROCESS, 0)
    assert process.answer() is None  # nobody waits for it
    process.close()
    with pytest.raises(ProcessLookupError):
        os.kill(number, 0)


def test_a_diagnosis_that_fails_is_said_and_the_next_one_runs(beside):
    process, runs = beside
    for fault, said in (
        (lambda directory: 1 / 0, "did not end"),
        (lambda directory: os._exit(1), None),  # the same again is not said again
        (diagnose_measured, "no campaign"),
    ):
        runs(fault)
        process.ask()
        told = process.answer(wait=True)
        assert told is None if said is None else said in (told or "")
