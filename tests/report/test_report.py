"""`planner report`: one file that works offline, says everything, and lets no name break it."""

import re
import shutil
import subprocess
from html.parser import HTMLParser

import pytest

from planner.campaign.campaign import Campaign
from planner.report.page import write_report
from planner.report.text import SIMULATED, with_sd
from tests.support.named_campaign import DOLLAR, SCRIPT
from tests.support.outside import refused, said

LARGEST_BYTES = 5_000_000
ALONE = {"img", "meta", "br"}  # elements without an end


class Reader(HTMLParser):
    """Elements, their attributes, text; whether every element is closed where it belongs."""

    def __init__(self):
        super().__init__()
        self.open, self.tags, self.sources, self.text, self.crossed = [], [], [], [], []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.sources += [v for k, v in attrs if k in ("src", "href", "srcset", "action")]
        self.tags += [k for k, _ in attrs if k.startswith("on")]
        if tag not in ALONE:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.crossed.append(tag)

    def handle_data(self, data):
        self.text.append(data)


@pytest.fixture(scope="module")
def report(named, tmp_path_factory):
    """The campaign, its report's answer, and the file as it was read."""
    folder, campaign = tmp_path_factory.mktemp("report"), named
    (folder / "out").mkdir()
    answer = write_report(campaign, folder / "out" / "report.html", None)
    html = (folder / "out" / "report.html").read_text()
    reader = Reader()
    reader.feed(html)
    return campaign, answer, html, reader


def test_it_is_one_file_that_loads_nothing_from_elsewhere(report):
    _, answer, html, reader = report
    assert answer.keys["bytes"] == len(html.encode()) < LARGEST_BYTES
    assert (reader.open, reader.crossed) == ([], [])
    assert all(s.startswith(("data:image/png;base64,", "#")) for s in reader.sources)
    assert not re.search(r"url\(|@import|https?://", html)
    assert "default-src 'none'" in html


def test_names_are_text_whatever_they_hold(report):
    *_, html, reader = report
    text = "".join(reader.text)
    assert not {"script", "b onclick", "i"} & set(reader.tags)
    assert SCRIPT not in html
    assert SCRIPT in text
    assert DOLLAR in text
    assert "<b>torn.uff" in text
    assert "<i>frozen</i>" in text  # campaign.toml is quoted


def test_it_says_what_was_asked_measured_refused_and_how_good_it_is(report):
    campaign, answer, _, reader = report
    text = " ".join("".join(reader.text).split())
    assert SIMULATED.plain in text
    assert answer.keys["simulated"]
    state = campaign.state
    for measurement in state.used:
        for mode in measurement.modes:
            known = with_sd(mode.frequency_hz, mode.frequency_sd_hz, ".3f")
            assert not mode.likely or known in text
    refused = [hit for m in state.recorded for hit in m.hits if not hit.accepted]
    assert len(refused) == 1
    assert refused[0].reason in text
    for hit in (h for m in state.recorded for h in m.hits):
        assert hit.sha256 in text
    for line in campaign.model.forecast.known.split(". "):
        assert " ".join(line.split()) in text
    assert "predicted without it" in text
    assert len(re.findall(r"imported \d+ of \d+ hits", text)) == 2
    # Held-out quality, two modes' maps, two poses' FRFs.
    assert sum(s.startswith("data:image/png") for s in reader.sources) == 5


@pytest.mark.skipif(shutil.which("chromium") is None, reason="no browser on this machine")
def test_a_browser_shows_it_and_prints_it(report, tmp_path):
    file = tmp_path / "report.html"
    file.write_text(report[2])
    call = ["chromium", "--headless", "--no-sandbox", "--disable-gpu"]
    call.append(f"--user-data-dir={tmp_path}")
    shown = subprocess.run([*call, "--dump-dom", file.as_uri()], capture_output=True, text=True,
                           check=True, timeout=120).stdout  # fmt: skip
    assert shown.count("<section") == report[2].count("<section")
    assert "Content Security Policy" not in shown
    pdf = tmp_path / "report.pdf"
    subprocess.run([*call, f"--print-to-pdf={pdf}", file.as_uri()], capture_output=True,
                   check=True, timeout=120)  # fmt: skip
    assert pdf.read_bytes().startswith(b"%PDF")
    assert len(re.findall(rb"/Type\s*/Page\b", pdf.read_bytes())) > 2


def test_a_campaign_without_measurements_has_a_report_too(tmp_path, report):
    source = report[0].directory
    cell = Campaign.new(
        tmp_path / "cell", source / "robot" / "robot.toml", source / "campaign.toml"
    )
    said("report", cell.directory)
    assert "Nothing has been measured yet" in (tmp_path / "cell" / "report.html").read_text()
    refused("report", cell.directory, "--out", tmp_path)
    none = refused("report", cell.directory, "--diagnosis", tmp_path / "none")
    assert "diagnose --out" in none
