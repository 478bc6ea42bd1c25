"""From hits with one tool to the lobes of another, at poses never measured, on a concealed KR210.

Hits with the reference rod → modes → fusion → coupling to a longer, heavier tool → lobes, beside
the same coupling of the truth's own six by six receptances (MuJoCo); limits by the zeroth order,
which takes both FRFs as they are. `pytest -m slow -s` prints the figures; SEED and POSES say of
which robot and at how many poses.
"""

import os
from pathlib import Path

import numpy as np
import pytest

from planner.campaign.campaign import Campaign
from planner.milling.coupling import TipReceptance, couple
from planner.milling.tool_file import load_tool
from planner.report.coupling_source import tip_at
from planner.truth.arms import KR210
from planner.truth.deviation import Deviation, Spring
from planner.truth.hits import Hammer, record_poses
from planner.truth.load import load_truth
from planner.truth.model import Truth
from tests.support.milling_cases import cut
from tests.support.true_limits import limit_pair

SEED, POSES = int(os.environ.get("SEED", "401")), int(os.environ.get("POSES", "50"))
MEASURED, SAMPLES, NEAR = 5, 48, 0.10
BAND_HZ = (4.0, 60.0)
HAMMER = Hammer(peak_n=800, duration_s=0.004, sampling_rate_hz=640, record_s=2.4)
TRUE_LINES = np.arange(2.0, 100.01, 0.1)  # of the truth, beyond the band that is measured
MATERIAL = """
to_spindle = [0.0, 0.0, -1.0]
[material.steel]
youngs_modulus_pa = 2.1e11
density_kg_m3 = 7850.0
poisson_ratio = 0.3
loss_factor = 0.002
"""
SEGMENT = """
[[segment]]
material = "steel"
length_m = {}
diameter_m = {}
"""
CONTACT = """[segment.contact]
stiffness_n_m = 5e7
stiffness_nm_rad = 3e5
damping_ns_m = 200.0
damping_nms_rad = 1.0
"""
REFERENCE = MATERIAL + SEGMENT.format(0.05, 0.02) + CONTACT
TARGET = MATERIAL + SEGMENT.format(0.10, 0.063) + CONTACT + SEGMENT.format(0.08, 0.025)


def concealed(folder: Path) -> tuple[Path, Truth]:
    """robot.toml with two springs a joint; the truth is off in all numbers, on a soft floor."""
    robot = KR210.write(folder / "robot", 2)
    stiffness = 25 * max(KR210.torsion)
    floor = tuple(
        Spring("base", axis, stiffness, 3e-4 * stiffness) for axis in ((1.0, 0, 0), (0, 1.0, 0))
    )
    return robot, load_truth(robot, Deviation(SEED, 0.2, 0.2, 0.05, 0.005, extra=floor))


def six_by_six(truth: Truth, q: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """(6, 6, F) in m/N and the like at the tip."""
    mass, damping, stiffness, hit, _ = truth.matrices(q)
    both = np.concatenate([hit, truth.turning(q)])
    found = [both @ np.linalg.solve(stiffness + 1j * w * damping - w**2 * mass, both.T)
             for w in 2 * np.pi * lines]  # fmt: skip
    return np.moveaxis(np.array(found), 0, -1)


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_limits_of_another_tool_at_poses_never_measured(tmp_path: Path):
    robot, truth = concealed(tmp_path)
    text = KR210.campaign(str(robot)).replace(str(list(KR210.band_hz)), str(list(BAND_HZ)))
    (tmp_path / "campaign.toml").write_text(text)
    tools = []
    for name, said in (("reference", REFERENCE), ("target", TARGET)):
        (tmp_path / f"{name}.toml").write_text(said)
        tools.append(load_tool(tmp_path / f"{name}.toml"))
    reference, target = tools
    campaign = Campaign.new(tmp_path / "cell", robot, tmp_path / "campaign.toml")
    offered = campaign.cell.candidates.q[: MEASURED + POSES]
    named = [(f"P{i}", q) for i, q in enumerate(offered[:MEASURED])]
    record_poses(truth, named, tmp_path / "hits", repeats=2, hammer=HAMMER, seed=SEED)
    campaign.import_paths((tmp_path / "hits",))
    q, lines = offered[MEASURED:], campaign.frequency_lines
    mean, sd = campaign.frf(q)
    given = cut(
        diameter_m=0.025, kt_n_m2=8.8e8, kr_n_m2=2.0e8, milling="down", radial_immersion=0.5,
        axis=(0.0, 0.0, -1.0), spindle_rpm=(600.0, 3600.0, 6), depth_m=(0.0, 0.05, 200),
        method="zeroth_order",
    )  # fmt: skip
    pairs, untouched = [], []
    for i, one in enumerate(q):
        tip = tip_at(campaign, f"T{i}", one, lines, mean[i], sd[i])
        told = couple(tip, target, reference)
        exact = TipReceptance.known(TRUE_LINES, six_by_six(truth, one, TRUE_LINES))
        true = couple(exact, target, reference).accelerance[:3, :3]
        own = exact.receptance[:, :3, :3].transpose(1, 2, 0) * (2j * np.pi * TRUE_LINES) ** 2
        untouched.append(np.linalg.norm(own - true) / np.linalg.norm(true))
        pair = limit_pair(
            given, lines, told.accelerance[:3, :3], told.accelerance_sd[:3, :3], true, SAMPLES,
            TRUE_LINES,
        )  # fmt: skip
        pairs.append(pair)
        print(i, (100 * pair.off).round(1), pair.inside.astype(int), flush=True)
    off, inside = np.array([p.off for p in pairs]), np.array([p.inside for p in pairs])
    print(
        f"seed {SEED}, {len(off)} poses × 6 speeds: within 10 % {100 * np.mean(off < NEAR):.1f} %, "
        f"median off {100 * np.median(off):.2f} %, all speeds within 10 % at "
        f"{100 * np.mean(np.all(off < NEAR, axis=1)):.0f} % of the poses; the true limit inside "
        f"the 90 % band {100 * np.mean(inside):.1f} %; the tools differ by "
        f"{100 * np.median(untouched):.0f} % of the FRFs"
    )
    assert np.mean(off < NEAR) >= 0.9
    assert np.mean(inside) >= 0.85
