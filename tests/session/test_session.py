"""The terminal session with a fake analyser that writes slowly and a scripted engineer."""

import io
import os
import re
import shutil
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from msgspec.structs import replace
from rerun.chunk import RrdReader
from rich.console import Console

from planner.campaign.campaign import Campaign
from planner.dataset.screened_files import Source
from planner.recording.folder import TABLE
from planner.replay import replay
from planner.report.rerun.story import Story
from planner.session.diagnosis_process import DiagnosisProcess, diagnose_measured
from planner.session.teller import Teller
from planner.session.watch import watch
from planner.truth.hits import simulate_hit, write_uff
from tests.support.hit_csv import write_csv
from tests.support.outside import HAMMER, make_cell, record

SIX = ("+x", "+x", "+y", "+y", "+z", "+z")
WANTED = (
    "joint_a1",
    "angle (°)",
    "expected (Hz)",
    "damping (%)",
    "tool at x",
    "measured (Hz)",
    "off by (sd)",
    "sd of frequencies",
    "target 1 %",
    "min per pose",
    "SIMULATED",
)


class Script:
    """Keys pressed when their moment has come: a function of the session's screen so far."""

    def __init__(self, console, presses):
        self.console, self.presses = console, list(presses)
        self.text = ""

    def get(self, timeout_s):
        time.sleep(min(timeout_s, 0.05))
        self.text = self.console.export_text(clear=False)
        if self.presses and self.presses[0][0](self.text):
            return self.presses.pop(0)[1]
        return None


@pytest.fixture
def cell(tmp_path):
    robot, campaign_toml, truth = make_cell(tmp_path)
    campaign = Campaign.new(tmp_path / "cell", robot, campaign_toml)
    (tmp_path / "inbox").mkdir()
    return campaign, truth, tmp_path


def screen():
    return Console(width=100, record=True, file=io.StringIO(), force_terminal=False)


def deliver(truth, tmp_path, proposal, number, torn=False):
    """Export the hits of a pose, each file in two writes."""
    folder = record(truth, tmp_path / f"made{number}", proposal.pose, proposal.joints_deg, number)
    for path in sorted((folder / "data").iterdir()):
        data, target = path.read_bytes(), tmp_path / "inbox" / path.name
        target.write_bytes(data[: len(data) // 3])
        time.sleep(0.02)
        if not torn:
            target.write_bytes(data)


def wait(text):
    return lambda screen: text in screen


def test_a_session_shows_imports_and_goes_on(cell):
    campaign, truth, tmp_path = cell
    console = screen()
    proposal = campaign.next()[0]
    analyser = threading.Thread(target=deliver, args=(truth, tmp_path, proposal, 0))
    script = Script(console, [
        (wait("all hits are in"), "?"), (wait("set bad hits, or all, aside"), "s"),
        (wait("★"), "a"), (wait("Pose P001: 9 hits in"), "k"), (wait("stands in the way?"), "\n"),
        (wait("not be offered"), "u"),
        (wait("Took back"), "q"),
    ])  # fmt: skip
    analyser.start()
    summary = watch(campaign, tmp_path / "inbox", console=console, keys=script,
                    hits_per_pose=9, quiet_s=0.15, limit_s=60)  # fmt: skip
    analyser.join()
    text = console.export_text(clear=False)
    print(text)
    assert summary.stopped == "quit"
    assert summary.measured == ("P001",)
    for wanted in WANTED:
        assert wanted in text, wanted
    assert max(len(line) for line in text.splitlines()) <= 100
    assert campaign.state.starred == {"P001"}
    assert not campaign.state.skipped


def test_resume_ignores_what_was_imported_and_waits_for_torn_files(cell):
    campaign, truth, tmp_path = cell
    proposal = campaign.next()[0]
    deliver(truth, tmp_path, proposal, 0)
    inbox = tmp_path / "inbox"
    first = watch(campaign, inbox, console=screen(), keys=Script(screen(), []), auto=True,
                  hits_per_pose=9, quiet_s=0.05, limit_s=4)  # fmt: skip
    assert first.measured == ("P001",)
    again = Campaign(campaign.directory)
    deliver(truth, tmp_path, again.next()[0], 1, torn=True)
    console = screen()
    second = watch(again, inbox, console=console, keys=Script(screen(), []), auto=True,
                   hits_per_pose=9, quiet_s=0.05, limit_s=3)  # fmt: skip
    assert second.measured == ()
    assert second.stopped == "time limit"
    assert "not whole yet" in console.export_text()
    assert list(again.state.measurements) == ["P001"]


def test_refused_hits_are_not_offered_again_even_by_the_next_session(cell):
    campaign, truth, tmp_path = cell
    deliver(truth, tmp_path, campaign.next()[0], 0)
    console = screen()
    script = Script(console, [(wait("all hits are in"), "r"), (wait("No hit is to be"), "r"),
                              (wait("9 hits set aside (1, 2, 3"), "a"),
                              (wait("Nothing to import yet"), "q")])  # fmt: skip
    watch(campaign, tmp_path / "inbox", console=console, keys=script, hits_per_pose=9,
          quiet_s=0.05, limit_s=30)  # fmt: skip
    assert campaign.state.measurements == {}
    again = Campaign(campaign.directory)
    assert len(again.state.refused) == 9
    summary = watch(again, tmp_path / "inbox", console=screen(), keys=Script(screen(), []),
                    auto=True, hits_per_pose=9, quiet_s=0.05, limit_s=2)  # fmt: skip
    assert summary.measured == ()
    assert again.state.measurements == {}
    # Taken back, they wait again, at the same pose.
    console = screen()
    script = Script(console, [(wait("[u] undo"), "u"), (wait("all hits are in"), "a"),
                              (wait("P001: 9 hits in"), "q")])  # fmt: skip
    watch(again, tmp_path / "inbox", console=console, keys=script, hits_per_pose=9,
          quiet_s=0.05, limit_s=30)  # fmt: skip
    assert list(again.state.measurements) == ["P001"]
    assert again.state.refused == {}


@pytest.mark.parametrize(
    ("key", "said", "used", "refused"),
    [("a", "1 hit set aside (", 5, 1), ("h", "are used, as you said", 6, 0),
     ("r", "1 hit set aside (", 5, 1)],
)  # fmt: skip
def test_a_hit_along_another_axis_than_said_is_asked_about(cell, key, said, used, refused):
    campaign, truth, tmp_path = cell
    proposal = campaign.next()[0]
    q, rng = np.deg2rad(proposal.joints_deg), np.random.default_rng(3)
    for number, (axis, stated) in enumerate(zip([*SIX[:5], "+y"], SIX, strict=True)):
        hit = simulate_hit(truth, q, axis, HAMMER, rng)
        hit = type(hit)(stated, hit.force_n, hit.acceleration_m_s2)
        write_uff(tmp_path / "inbox" / f"h{number}.uff", hit, HAMMER)
    console = screen()
    keys = [(wait("right?"), key), (wait("aside (" if key == "r" else "z  "), "a")]
    keys += [] if key == "h" else [(wait("Hits are missing"), "a")]
    script = Script(console, [*keys, (wait(said), "q")])
    watch(campaign, tmp_path / "inbox", console=console, keys=script, hits_per_pose=6,
          quiet_s=0.05, limit_s=60)  # fmt: skip
    text = " ".join(console.export_text(clear=False).split())
    assert said in text
    (measured,) = campaign.state.used
    assert len(measured.accepted) == used
    reasons = [hit.reason for _, hit in campaign.state.refused.values()]
    assert len(reasons) == refused
    assert all("disagrees with hit" in r and "refused by the engineer" in r for r in reasons)


@pytest.fixture
def four(cell):
    """The cell after four poses, and a proposal at which the hits of another pose arrive."""
    campaign, truth, tmp_path = cell
    for number in range(4):
        pose = campaign.next()[0]
        folder = record(truth, tmp_path / f"made{number}", pose.pose, pose.joints_deg, number)
        (report,) = campaign.import_paths((folder,))
        assert report.question is None
    stated, true = campaign.next(2)
    made = replace(true, pose=stated.pose)
    deliver(truth, tmp_path, made, 9)
    return campaign, tmp_path, stated.pose, true.pose


def test_without_anybody_to_ask_hits_of_another_pose_are_held(four):
    campaign, tmp_path, stated, true = four
    console = screen()
    summary = watch(campaign, tmp_path / "inbox", console=console, keys=Script(screen(), []),
                    auto=True, hits_per_pose=9, quiet_s=0.05, limit_s=4)  # fmt: skip
    asked = campaign.state.held[stated].question
    assert asked is not None
    assert asked.fits == true
    assert summary.questions == {stated: asked.text}
    assert summary.measured == ()
    text = " ".join(console.export_text().split())
    assert f"Held back, not used: {asked.text}" in text
    assert f"go to pose {true}" in text
    assert len(campaign.state.used) == 4


@pytest.mark.parametrize(
    ("key", "said", "used", "refused"),
    [("a", "are used", "stated", 0), ("r", "set aside", None, 9), ("o", "9 hits in", "true", 0)],
)
def test_the_question_survives_the_session_and_is_answered_by_a_key(four, key, said, used, refused):
    campaign, tmp_path, stated, true = four
    console, inbox = screen(), tmp_path / "inbox"
    script = Script(console, [(wait("all hits are in"), "a"), (wait("Is the robot at"), "q")])
    first = watch(campaign, inbox, console=console, keys=script, hits_per_pose=9, quiet_s=0.05,
                  limit_s=30)  # fmt: skip
    assert list(first.questions) == [stated]
    assert len(campaign.state.used) == 4
    again, console = Campaign(campaign.directory), screen()
    script = Script(console, [(wait("Is the robot at"), key), (wait(said), "q")])
    second = watch(again, inbox, console=console, keys=script, hits_per_pose=9, quiet_s=0.05,
                   limit_s=30)  # fmt: skip
    assert second.questions == {}
    names = {"stated": [stated], "true": [true], None: []}[used]
    assert [m.pose for m in again.state.used][4:] == names
    assert len(again.state.refused) == refused
    assert not again.state.held


def test_a_table_of_recordings_in_the_folder_gives_the_readback(cell):
    campaign, truth, tmp_path = cell
    proposal = campaign.next()[0]
    folder = record(truth, tmp_path / "made", proposal.pose, proposal.joints_deg)
    shutil.rmtree(tmp_path / "inbox")
    shutil.copytree(folder, tmp_path / "inbox")
    rrd = tmp_path / "session.rrd"
    for limit_s in (4, 1):  # the second session resumes, and its recording tells it all
        watch(campaign, tmp_path / "inbox", console=screen(), keys=Script(screen(), []), auto=True,
              hits_per_pose=9, quiet_s=0.05, limit_s=limit_s, rrd=rrd)  # fmt: skip
    reader = RrdReader(rrd)
    seen = {str(chunk.entity_path) for chunk in reader.stream(store=reader.recordings()[0])}
    assert {"/note", "/frf/xx/0/measured", "/cell/measured", "/cell/proposed"} <= seen
    measured = campaign.state.measurements[proposal.pose].joints_deg
    off = np.max(np.abs(np.subtract(measured, proposal.joints_deg)))
    assert 0 < off <= 0.011


def test_files_that_do_not_say_their_axis_wait_for_the_table(cell):
    """The table is written while the session runs; nothing is called a bad hit."""
    campaign, truth, tmp_path = cell
    proposal = campaign.next()[0]
    made = record(truth, tmp_path / "made", proposal.pose, proposal.joints_deg)
    inbox, table = tmp_path / "inbox", (made / TABLE).read_text()
    for path in sorted((made / "data").iterdir()):
        (hit,), _ = Source(path, path.name).read()
        write_csv(inbox / f"{path.stem}.csv", hit, stated=False)
    console = screen()

    def ask(text):
        if "9 of no stated axis" not in text:
            return False
        (inbox / TABLE).write_text(table.replace("data/", "").replace(".uff", ".csv"))
        return True

    script = Script(console, [(ask, "s"), (wait("all hits are in"), "a"),
                              (wait("P001: 9 hits in"), "q")])  # fmt: skip
    watch(campaign, inbox, console=console, keys=script, hits_per_pose=9, quiet_s=0.05,
          limit_s=30)  # fmt: skip
    text = console.export_text()
    assert "along which axis? " in text
    assert '"# hit: +x"' in text
    assert "REPEAT HIT" not in text
    assert len(campaign.state.used[0].accepted) == 9


def test_undo_after_an_interrupted_import_takes_it_back_with_its_proposal(cell, monkeypatch):
    """What the import gave was never on the screen: the next session begins with it."""
    campaign, truth, tmp_path = cell
    proposal = campaign.next()[0]
    deliver(truth, tmp_path, proposal, 0)
    inbox, console = tmp_path / "inbox", screen()
    script = Script(console, [(wait("all hits are in"), "a")])
    with monkeypatch.context() as patched:
        patched.setattr(Teller, "note", interrupt)  # right after the import
        watch(campaign, inbox, console=console, keys=script, hits_per_pose=9, quiet_s=0.05,
              limit_s=30)  # fmt: skip
    assert "the hits of P001: that is in the log; planner undo" in flat(console)
    console = screen()
    script = Script(console, [(wait("go to pose P002"), "q")])
    watch(Campaign(campaign.directory), inbox, console=console, keys=script, quiet_s=0.05)
    assert re.search(r"The last import, P001: [\d.]+ Hz \(expected [\d.]+, .* sd\)", flat(console))
    taken = Campaign(campaign.directory).undo(decisions_only=True)  # as the session's own key does
    assert [type(e.event).__name__ for e in taken] == ["Imported", "Proposed"]
    again = Campaign(campaign.directory)
    assert again.state.measurements == {}
    assert again.next()[0] == proposal
    assert all(step.check in ("identical", "kept") for step in replay(again))


def interrupt(teller, reports=()):
    if reports:
        raise KeyboardInterrupt


def flat(console) -> str:
    return " ".join(console.export_text(clear=False).split())


def test_a_skip_asks_for_its_reason_and_typing_runs_no_command(cell):
    campaign, _, tmp_path = cell
    console = screen()
    keys = [
        (wait("go to pose P001"), "k"),
        (wait("stands in the way?"), "q"),
        (wait(" q_"), "\x7f"),
    ]
    keys += [(lambda text: True, letter) for letter in "husk"] + [(wait(" husk_"), "\n")]
    script = Script(console, [*keys, (wait("P001 and poses around it will not"), "q")])
    summary = watch(campaign, tmp_path / "inbox", console=console, keys=script, limit_s=30)
    assert summary.stopped == "quit"
    assert campaign.state.skipped == {"P001": "husk"}
    assert campaign.state.avoided == {"P001"}


def test_as_many_hits_make_a_pose_as_the_campaign_file_says(cell):
    campaign, truth, tmp_path = cell
    decided = campaign.directory / "campaign.toml"
    decided.write_text(decided.read_text() + "\n[cost]\nhits_per_axis = 3\n")
    campaign = Campaign(campaign.directory)
    deliver(truth, tmp_path, campaign.next()[0], 0)
    console = screen()
    script = Script(console, [(wait("all hits are in"), "q")])
    watch(campaign, tmp_path / "inbox", console=console, keys=script, quiet_s=0.05, limit_s=20)
    assert "x  3/3" in console.export_text()


def test_the_next_pose_is_on_the_screen_before_pictures_are_made(cell, monkeypatch):
    campaign, truth, tmp_path = cell
    deliver(truth, tmp_path, campaign.next()[0], 0)
    console, told = screen(), []

    def tell(story, entry, model, measured=None):
        shown = "Measurement 2: go to pose P002" in console.export_text(clear=False)
        told.append((type(entry.event).__name__, len(model.labelled), shown, measured is not None))

    monkeypatch.setattr(Story, "tell", tell)
    watch(campaign, tmp_path / "inbox", console=console, keys=Script(screen(), []), auto=True,
          hits_per_pose=9, quiet_s=0.05, limit_s=4)  # fmt: skip
    assert told == [("Imported", 1, True, True), ("Proposed", 1, True, False)]


def test_pictures_that_are_interrupted_are_made_at_the_end(cell, monkeypatch):
    campaign, truth, tmp_path = cell
    deliver(truth, tmp_path, campaign.next()[0], 0)
    begun = []

    def tell(story, entry, model, measured=None):
        begun.append(type(entry.event).__name__)
        if len(begun) == 1:
            raise KeyboardInterrupt

    monkeypatch.setattr(Story, "tell", tell)
    summary = watch(campaign, tmp_path / "inbox", console=screen(), keys=Script(screen(), []),
                    auto=True, hits_per_pose=9, quiet_s=0.05, limit_s=20)  # fmt: skip
    assert summary.stopped == "quit"
    assert begun == ["Imported", "Imported", "Proposed"]


def stand_in(*answers):
    """A diagnosis that says (verdict, text) by how many poses are measured."""

    def diagnose(directory):
        from types import SimpleNamespace

        from planner.campaign.campaign import Campaign

        verdict, text = answers[len(Campaign(directory).state.used) - 1]
        findings = [SimpleNamespace(text=text)] if text else []
        return SimpleNamespace(verdict=verdict, findings=findings)

    return diagnose


def test_the_diagnosis_runs_beside_the_session_and_is_said_when_it_is_through(cell, monkeypatch):
    """What it runs is a stand-in: what a diagnosis finds is tested where it is made."""
    campaign, truth, tmp_path = cell
    made = stand_in(("consistent", ""), ("explained", "The floor gives way."))
    monkeypatch.setattr("planner.session.diagnosis_process.diagnose_measured", made)
    monkeypatch.setattr("planner.session.watch.LEAST", 1)
    inbox = tmp_path / "inbox"
    console = screen()
    for number in range(2):
        deliver(truth, tmp_path, campaign.next()[0], number)
        watch(campaign, inbox, console=console, keys=Script(screen(), []), auto=True,
              explain=True, hits_per_pose=9, quiet_s=0.05, limit_s=4)  # fmt: skip
    text = console.export_text()
    print(text)
    assert "Diagnosis: The simulation, once refitted, explains the recordings" in text
    assert "Diagnosis: The floor gives way." in text


def test_a_diagnosis_that_was_asked_for_meanwhile_follows_and_says_only_what_is_new(
    tmp_path, monkeypatch
):
    found = SimpleNamespace(verdict="unexplained", findings=[SimpleNamespace(text="At 20 Hz.")])
    monkeypatch.setattr(
        "planner.session.diagnosis_process.diagnose_measured", lambda directory: found
    )
    beside = DiagnosisProcess(tmp_path)
    assert beside.told() is None
    beside.ask()
    beside.ask()
    assert (beside.told(wait=True) or "").endswith("At 20 Hz.")
    beside.ask()
    assert beside.told(wait=True) is None  # nothing new
    beside.ask()
    beside.close()
    assert beside.told() is None


def test_a_diagnosis_goes_at_low_priority_and_ends_with_the_session(tmp_path, monkeypatch):
    note = tmp_path / "note"

    def endless(directory):
        import os
        import time

        note.with_suffix(".part").write_text(f"{os.getpid()} {os.getpriority(os.PRIO_PROCESS, 0)}")
        note.with_suffix(".part").rename(note)
        time.sleep(600)

    monkeypatch.setattr("planner.session.diagnosis_process.diagnose_measured", endless)
    beside = DiagnosisProcess(tmp_path)
    beside.ask()
    while not note.is_file():
        time.sleep(0.05)
    process, priority = map(int, note.read_text().split())
    assert priority > os.getpriority(os.PRIO_PROCESS, 0)
    assert beside.told() is None  # nobody waits for it
    beside.close()
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


def test_a_diagnosis_that_fails_is_said_and_the_next_one_runs(tmp_path, monkeypatch):
    where = "planner.session.diagnosis_process.diagnose_measured"
    beside = DiagnosisProcess(tmp_path)
    for fault, said in (
        (lambda directory: 1 / 0, "did not end"),
        (lambda directory: os._exit(1), None),  # the same again is not said again
        (diagnose_measured, "no campaign"),
    ):
        monkeypatch.setattr(where, fault)
        beside.ask()
        told = beside.told(wait=True)
        assert told is None if said is None else said in (told or "")
    beside.close()
