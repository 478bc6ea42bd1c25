"""A robot of four joints whose URDF has neither meshes nor collision elements."""

from pathlib import Path

from planner.campaign.campaign import Campaign
from planner.proof import descriptions
from planner.proof.deviation import Deviation
from planner.proof.load import load_truth
from planner.proof.model import Truth
from tests.support.outside import record

PLACES = [(0, 0, 0.3), (0, 0, 0.1), (0.4, 0, 0), (0.35, 0, 0)]
AXES = [(0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0)]
MASSES = [8.0, 6.0, 4.0, 2.0]
STIFFNESS = [4.0e4, 5.0e4, 3.0e4, 8.0e3]
JOINTS_DEG = [(-60, 60), (-80, -10), (10, 90), (-90, 90)]
BAND_HZ = (3.0, 60.0)


def urdf() -> str:
    """The arm's URDF, links with inertias alone."""
    parts, parent = [descriptions.link("base_link")], "base_link"
    for i, (place, axis, mass) in enumerate(zip(PLACES, AXES, MASSES, strict=True), 1):
        moments = (0.01 * mass, 0.02 * mass, 0.02 * mass)
        inertial = descriptions.inertial(mass, (0.15, 0.01, 0.02), moments)
        names = f"joint_{i}", parent, f"link_{i}"
        parts.append(descriptions.link(f"link_{i}", inertial))
        parts.append(descriptions.joint(*names, place, axis, (-2.9, 2.9)))
        parent = f"link_{i}"
    parts.append(descriptions.frame("tcp", parent, (0.2, 0.03, 0.05)))
    return descriptions.urdf("plain", parts)


def make_plain_arm(folder: Path, softer: float = 1.0, damping_s: float = 4e-4) -> Path:
    """Write the robot folder, its springs that much softer; returns robot.toml."""
    lines = descriptions.head("plain arm", "plain.urdf", "tcp", "tcp", BAND_HZ)
    for i, (axis, k) in enumerate(zip(AXES, STIFFNESS, strict=True), 1):
        lines.append(descriptions.compliance(f"joint_{i}", axis, k / softer, damping_s))
    return descriptions.write_robot(folder, "plain.urdf", urdf(), lines)


def plain_campaign(path: Path, acquisition: str = "integrated_variance") -> Path:
    """Write a small campaign.toml over the arm's joint box; returns its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    more = f'name = "{acquisition}"\ncandidates = 30\n'
    goal = "[goal]\njoints_deg = [[0, -40, 50, 0], [20, -40, 50, 10]]\n"
    path.write_text(descriptions.campaign(JOINTS_DEG, 2, BAND_HZ, more + goal))
    return path


def measured_poses(root: Path, count: int) -> tuple[Campaign, Truth]:
    """A campaign after so many proposals, whose simulation learns, and the true arm."""
    robot, plan = make_plain_arm(root / "robot"), plain_campaign(root / "plan" / "campaign.toml")
    truth = load_truth(robot, Deviation(3, 0.12, 0.1, 0.04, 0.003))
    campaign = Campaign.new(root / "cell", robot, plan)
    for number in range(count):
        (pose,) = campaign.next()
        made = record(truth, root / f"made{number}", pose.pose, list(pose.joints_deg), number)
        (report,) = campaign.import_paths((made,))
        assert report.question is None
    return campaign, truth
