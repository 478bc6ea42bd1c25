"""Streams of hits in a watched folder: judged hit by hit, whatever the format."""

from planner.session.watch import watch
from tests.session.test_session import Script, cell, screen, wait  # noqa: F401
from tests.support.outside import HAMMER, record
from tests.support.streams import joined, write_wav


def test_streams_wait_for_their_scales_and_are_judged_hit_by_hit(cell):  # noqa: F811
    campaign, truth, tmp_path = cell
    proposal = campaign.next()[0]
    made = record(truth, tmp_path / "made", proposal.pose, proposal.joints_deg)
    inbox, rate = tmp_path / "inbox", round(HAMMER.sampling_rate_hz)
    for axis in "xyz":
        samples = joined(made, f"p{axis}")
        if axis == "x":  # the second hit rebounds
            top = rate + int(samples[0, rate : 4 * rate].argmax())
            samples[0, top + 40 : top + 80] += 0.5 * samples[0, top - 20 : top + 20]
        write_wav(inbox / f"{axis}.wav", samples, f"+{axis}", rate_hz=rate)
    table = (inbox / "channels.csv").read_text()
    (inbox / "channels.csv").unlink()
    console = screen()

    def scale(text):
        if "says nothing of scale" not in " ".join(text.split()):
            return False
        (inbox / "channels.csv").write_text(table)
        return True

    script = Script(console, [
        (scale, "s"), (wait("3 hits in x.wav: 2 good"), "a"), (wait("Hits are missing"), "a"),
        (wait("P001: 8 hits in"), "q"),
    ])  # fmt: skip
    watch(campaign, inbox, console=console, keys=script, hits_per_pose=9, quiet_s=0.05,
          limit_s=40)  # fmt: skip
    text = " ".join(console.export_text().split())
    assert "3 hits in y.wav: 3 good" in text
    assert "refused x.wav (hit 2 at 2.47 s)" in text
    assert len(campaign.state.used[0].accepted) == 8
