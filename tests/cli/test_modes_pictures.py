"""`planner modes` draws what it found: files, a Rerun recording, and sentences for bad folders."""

import subprocess
import sys

import pytest
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font

from planner.report.pictures import rendered
from tests.support.outside import refused, said, told
from tests.support.rerun_columns import entities_of

NAMES = ["stabilisation", "frf", "coherence", "mac"]


@pytest.fixture(scope="module")
def hits(first_pose_once):
    """Simulated hits at one pose."""
    return first_pose_once.files


def test_pictures_are_written_and_named_on_screen(hits, tmp_path):
    flat = "".join(said("modes", *hits, "--plot", tmp_path / "new" / "folder").split())
    for name in NAMES:
        path = tmp_path / "new" / "folder" / f"{name}.png"
        assert path.read_bytes().startswith(b"\x89PNG")
        assert str(path) in flat


def test_pictures_are_listed_and_told_to_rerun(hits, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    options = "--plot", "here", "--format", "svg", "--rrd", "sub/modes.rrd"
    answer = told("modes", *hits, *options)
    expected = [tmp_path / "here" / f"{name}.svg" for name in NAMES]
    assert answer["plots"] == [str(path) for path in expected]
    assert answer["rrd"] == str(tmp_path / "sub" / "modes.rrd")
    for path in expected:  # titles stand in an SVG as comments
        assert "SIMULATED recordings" in path.read_text()
        assert hits[0].name in path.read_text()
    drawn = entities_of(answer["rrd"])
    assert {f"/figures/{name}/frame" for name in NAMES} | {"/note"} <= drawn
    assert any(name.startswith("/figures/stabilisation/0/") for name in drawn)  # sharp lines


def test_without_a_wish_nothing_is_drawn(hits):
    answer = told("modes", *hits)
    assert (answer["plots"], answer["rrd"]) == ([], None)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--plot", "taken"), "taken is a file; name a folder"),
        (("--plot", "blocked"), "blocked"),
        (("--plot", ".", "--format", "pdf"), "give png or svg"),
        (("--rrd", "taken/below.rrd"), "taken/below.rrd"),
    ],
)
def test_a_place_that_cannot_be_written_is_said(hits, tmp_path, monkeypatch, options, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("a file")
    (tmp_path / "blocked" / "stabilisation.png").mkdir(parents=True)
    err = refused("modes", *hits, "--json", *options)
    assert words in err
    assert "failed inside" not in err


def test_free_decays_are_drawn_without_frfs(shared_data, tmp_path):
    path = shared_data / "imphammer_mit" / "imp_ham_set1_nomass.CSV"
    answer = told("modes", path, "--force", "CH8", "--plot", tmp_path, "--format", "svg")
    names = [tmp_path / f"{name}.svg" for name in ("stabilisation", "mac")]
    assert answer["plots"] == [str(name) for name in names]
    assert all("SIMULATED" not in name.read_text() for name in names)


def test_matplotlib_and_rerun_are_only_imported_for_pictures(hits):
    program = (
        "import sys; from planner.cli.run import run\n"
        "code = run(sys.argv[1:])\n"
        "loaded = {'matplotlib', 'rerun'} & set(sys.modules)\n"
        "sys.exit(f'{code}, {loaded}' if code or loaded else 0)"
    )
    for arguments in (["--help"], ["modes", *map(str, hits), "--json"]):
        done = subprocess.run(
            [sys.executable, "-c", program, *arguments], capture_output=True, text=True, timeout=60
        )
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("form", ["png", "svg"])
def test_characters_that_a_font_lacks_are_drawn_by_another(form):
    """Without a warning (they are errors here), also where no font has them."""
    figure = Figure()
    lacking = figure.text(0.1, 0.5, "\u0416 \U00012000", fontfamily="cmr10")
    assert rendered(figure, format=form)
    first, *others = lacking.get_fontfamily()
    assert first == "cmr10"
    assert any(0x416 in get_font(findfont(name)).get_charmap() for name in others)
