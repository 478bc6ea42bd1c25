"""Streams of hits in a watched folder: judged hit by hit, whatever the format."""

from tests.support.outside import HAMMER
from tests.support.streams import joined, write_wav


def test_streams_wait_for_their_scales_and_are_judged_hit_by_hit(cell, first_pose, session):
    campaign, _, inbox = cell
    rate = round(HAMMER.sampling_rate_hz)
    for axis in "xyz":
        samples = joined(first_pose.made, f"p{axis}")
        if axis == "x":  # the second hit rebounds
            top = rate + int(samples[0, rate : 4 * rate].argmax())
            samples[0, top + 40 : top + 80] += 0.5 * samples[0, top - 20 : top + 20]
        write_wav(inbox / f"{axis}.wav", samples, f"+{axis}", rate_hz=rate)
    table = (inbox / "channels.csv").read_text()
    (inbox / "channels.csv").unlink()

    def scale(text):
        if "says nothing of scale" not in " ".join(text.split()):
            return False
        (inbox / "channels.csv").write_text(table)
        return True

    text = session(
        campaign, inbox, (scale, "s"), ("3 hits in x.wav: 2 good", "a"), ("Hits are missing", "a"),
        ("P001: 8 hits in", "q"), limit_s=40,
    ).flat  # fmt: skip
    assert "3 hits in y.wav: 3 good" in text
    assert "refused x.wav (hit 2 at 2.47 s)" in text
    assert len(campaign.state.used[0].accepted) == 8
