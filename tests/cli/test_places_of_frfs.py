"""Where FRFs as text were felt and hit: from recordings.csv, or, where asked, from file names."""

from pathlib import Path

import numpy as np
import pytest

from planner.dynamics.simulation import Simulation
from planner.errors import InputError
from planner.recording.read import place_in_name
from planner.robot.robot import Robot
from tests.support.cuts import SLOT
from tests.support.outside import refused, told

MODES = {"xx": (22.0, 0.03, 200.0), "yy": (27.0, 0.025, 250.0)}
CUT = SLOT.format("600, 1400, 5", "0.0, 0.02, 200", "full_discretisation")


def write_frf(path: Path, hertz: np.ndarray, values: np.ndarray, unit: str) -> None:
    """One FRF as a machinist's program writes it."""
    rows = [f"{f:.6g}\t{v.real:.9e}\t{v.imag:.9e}" for f, v in zip(hertz, values, strict=True)]
    path.write_text(f"Freq [Hz]\tReal [{unit}]\tImag [{unit}]\n" + "\n".join(rows) + "\n")


@pytest.mark.parametrize(
    ("name", "place"),
    [("tap_yx.txt", ("", "y", "", "x")), ("P1 +y-x.csv", ("", "+y", "", "-x")),
     ("H3_1.txt", ("3", "", "1", "")), ("frf_H31.csv.gz", ("3", "", "1", "")),
     ("plate-12z_3z.txt", ("12", "z", "3", "z"))],
)  # fmt: skip
def test_places_in_names(name, place):
    assert place_in_name(Path(name)) == place


@pytest.mark.parametrize("name", ["rec7.txt", "matrix.csv", "proxy.txt"])
def test_names_that_say_nothing(name):
    with pytest.raises(InputError, match="says neither axes nor nodes"):
        place_in_name(Path(name))


def test_a_tap_test_in_files_of_one_frf_each(tmp_path):
    taps, cut = tmp_path / "taps", tmp_path / "cut.toml"
    taps.mkdir()
    cut.write_text(CUT)
    hertz = np.arange(1, 400) * 0.25
    w, modes = 2 * np.pi * hertz, ""
    for name, (f, z, m) in MODES.items():
        wn = 2 * np.pi * f
        h = 1e6 / m / (wn**2 - w**2 + 2j * z * wn * w)
        write_frf(taps / f"tap_{name}.txt", hertz, h, "µm/N")
        axis = [1.0, 0.0, 0.0] if name == "xx" else [0.0, 1.0, 0.0]
        modes += f"[[mode]]\nfrequency_hz = {f}\ndamping_ratio = {z}\nmass_kg = {m}\n"
        modes += f"direction = {axis}\n"
    (tmp_path / "modes.toml").write_text(modes)
    assert "does not state its directions" in refused("stability", taps, "--cut", cut)
    found = told("stability", taps, "--cut", cut, "--from-names")
    right = told("stability", tmp_path / "modes.toml", "--cut", cut)
    np.testing.assert_allclose(found["depth_limit_m"], right["depth_limit_m"], rtol=1e-3)


@pytest.mark.parametrize("how", ["table", "names"])
def test_frfs_as_text_into_a_campaign(first_pose, tmp_path, how):
    cell, taps = first_pose.cell, tmp_path / "taps"
    taps.mkdir()
    loaded = Robot.load(first_pose.robot)
    hertz, q = np.arange(4.0, 60.0, 0.1), loaded.joints.internal(first_pose.joints_deg)
    simulation = Simulation(loaded)
    (h,) = simulation.accelerance(q, hertz)
    columns = [f"{name}_deg" for name in loaded.joint_names]
    rows = [f"pose,{','.join(columns)},hit,response,file"]
    for i, felt in enumerate("xyz"):
        for j, hit in enumerate("xyz"):
            write_frf(taps / f"tap_{felt}{hit}.txt", hertz, h[i, j], "m/s²/N")
            angles = ",".join(f"{a:.6f}" for a in first_pose.joints_deg)
            rows.append(f"{first_pose.pose},{angles},+{hit},+{felt},tap_{felt}{hit}.txt")
    if how == "table":
        (taps / "recordings.csv").write_text("\n".join(rows) + "\n")
    imported = told("import", cell, taps, *(["--from-names"] if how == "names" else []))
    assert len(imported["accepted"]) == 9
    (expected,) = simulation.modes(q, 1).frequency_hz
    assert imported["modes"][0]["frequency_hz"] == pytest.approx(expected[0], rel=1e-3)
    assert told("replay", cell)["reproduced"]
