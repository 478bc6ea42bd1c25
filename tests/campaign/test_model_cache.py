"""What is kept on disk: a fitted model is the same as a new one, never a damaged or outdated one;
recordings are looked through before the next fit, whole ones once."""

import json
import os
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest

from planner import content_hash, file_content
from planner.campaign import build as build_module
from planner.campaign.campaign import Campaign
from planner.campaign.model import Model
from planner.campaign.store import CONFIG
from planner.dataset.store import Store
from planner.errors import InputError
from planner.fit.fitted import FitRecord
from planner.replay import replay
from planner.report.status import status
from tests.support.outside import FROZEN, told
from tests.support.shipped_campaign import RECORDINGS, shipped_campaign

POSES = "A11", "A33"


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """A campaign of two poses, whose simulation stays as it is: no model takes long."""
    parent = tmp_path_factory.mktemp("two")
    return measured(parent, POSES).directory


def measured(parent, poses):
    campaign = shipped_campaign(parent, FROZEN, Store(None))
    for pose in poses:
        campaign.import_paths((RECORDINGS,), pose)
    return campaign


@pytest.fixture
def folder(two, tmp_path):
    return shutil.copytree(two, tmp_path / "campaign")


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "models")


@pytest.fixture
def fitted(monkeypatch):
    """Counts the models that are fitted."""
    count, build = [], build_module.build

    def counted(*given):
        count.append(given)
        return build(*given)

    monkeypatch.setattr(build_module, "build", counted)
    return count


def predictions(model):
    q, lines = model.cell.candidates.q[:3], np.linspace(5.0, 60.0, 12)
    p = model.predict(q)
    numbers = p.frequency_hz, p.frequency_sd_hz, p.damping_ratio, p.damping_sd, *model.frf(q, lines)
    return *numbers, model.frequency_sd_percent, np.array([model.forecast.rmse_percent])


def same(a, b):
    return all(np.array_equal(u, v) for u, v in zip(predictions(a), predictions(b), strict=True))


def alike(a, b):
    """Fitted to the same, each anew: to rounding, which hangs on where arrays lie in memory."""
    pairs = zip(predictions(a), predictions(b), strict=True)
    return all(np.allclose(u, v, rtol=1e-6, atol=1e-6 * np.abs(u).max()) for u, v in pairs)


def test_a_kept_model_is_the_fitted_one(two_poses, store, fitted):
    """Of a simulation that learns, too."""
    folder = two_poses[0].directory
    first, again = (Campaign(folder, store).model for _ in range(2))
    assert len(fitted) == 1
    assert again is not first
    anew = Campaign(folder, Store(None)).model
    assert len(fitted) == 2
    assert same(first, again)
    assert alike(anew, again)
    assert again.remarks == anew.remarks
    assert [p.pose for p in again.labelled] == ["P001", "P002"]


def test_another_configuration_program_or_folder_has_another_model(
    folder, store, fitted, monkeypatch, tmp_path
):
    first = Campaign(folder, store).model
    config = folder / CONFIG
    text = config.read_text()
    config.write_text(text + "# Nothing is changed by this.\n")
    Campaign(folder, store).model  # noqa: B018
    assert len(fitted) == 1
    config.write_text(
        re.sub(r"(?m)^frequency_sd_percent = .*$", "frequency_sd_percent = 0.123", text)
    )
    assert Campaign(folder, store).model.forecast.target_percent == 0.123
    assert len(fitted) == 2
    config.write_text(text)
    moved = shutil.copytree(folder, tmp_path / "moved")
    assert Campaign(moved, store).model.cell.robot.path.is_relative_to(moved)
    assert len(fitted) == 3
    monkeypatch.setattr(content_hash, "program", lambda *packages: "another")
    assert alike(first, Campaign(folder, store).model)
    assert len(fitted) == 4


def test_other_measurements_have_another_model_and_undoing_finds_the_first(folder, store, fitted):
    campaign = Campaign(folder, store)
    first = campaign.model
    campaign.withdraw(POSES[1])
    assert [p.pose for p in campaign.model.labelled] == list(POSES[:1])
    campaign.undo()
    assert same(first, campaign.model)
    assert len(fitted) == 2


def test_status_is_the_same_from_what_was_kept(folder, store, fitted):
    told = [status(Campaign(folder, store)).to_json() for _ in range(2)]
    anew = status(Campaign(folder, Store(None))).to_json()
    assert json.dumps(told[0]) == json.dumps(told[1])
    assert anew.keys() == told[0].keys()
    assert len(fitted) == 2


def test_replay_takes_no_model_that_was_kept(folder, store, monkeypatch):
    Campaign(folder, store).model  # noqa: B018

    def refused(*given):
        raise AssertionError("a kept model was asked for")

    kept = (Model, FitRecord)
    monkeypatch.setattr(Store, "get", lambda self, key, kind: refused() if kind in kept else None)
    steps = list(replay(Campaign(folder, store)))
    assert {step.check for step in steps} <= {"identical", "close", "kept"}
    assert len(steps[-1].model.labelled) == len(POSES)


def test_status_of_a_kept_model_needs_no_heavy_library(folder):
    assert told("status", folder)
    code = (
        "import sys; from planner.cli.run import run; "
        f"code = run(['status', {str(folder)!r}]); "
        "heavy = {'jax', 'pinocchio', 'scipy'} & set(sys.modules); "
        "sys.exit(code or len(heavy))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.fixture(scope="module")
def one(tmp_path_factory):
    """A campaign of one pose."""
    parent = tmp_path_factory.mktemp("one")
    return measured(parent, POSES[:1]).directory


@pytest.fixture
def measured_once(one, tmp_path):
    return shutil.copytree(one, tmp_path / "campaign")


@pytest.fixture
def look(measured_once, tmp_path, monkeypatch):
    """Looks through a campaign's recordings as the next command does; the files that it reads."""
    read = file_content.read

    def looked():
        names = []
        with monkeypatch.context() as patched:
            patched.setattr(file_content, "_hashes", {})
            patched.setattr(file_content, "_contents", type(file_content._contents)())
            patched.setattr(file_content, "read", lambda path: names.append(path) or read(path))
            campaign = Campaign(measured_once, Store(tmp_path / "found"))
            campaign.recordings.look_through(campaign.state.used, Store(tmp_path / "found"))
        return [path for path in names if path.parent.name == "recordings"]

    return looked


def test_whole_ones_are_read_once(look, tmp_path):
    first = look()
    assert len(first) == 12
    assert look() == []
    os.utime(first[0])  # somebody has touched one
    assert look() == first[:1]
    (entry,) = (tmp_path / "found").iterdir()
    entry.write_bytes(entry.read_bytes()[:-1])  # what is kept of them is damaged
    assert look() == first


@pytest.mark.parametrize("damage", ["cut", "flipped", "gone"])
def test_a_damaged_one_is_told(look, damage):
    path = look()[-1]
    data, times = path.read_bytes(), path.stat()
    if damage == "gone":
        path.unlink()
    else:
        flipped = data[:-1] + bytes([data[-1] ^ 1])
        path.write_bytes(data[:-1] if damage == "cut" else flipped)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    for _ in range(2):
        with pytest.raises(InputError, match=path.name):
            look()
    path.write_bytes(data)
    look()
