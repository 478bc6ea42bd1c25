"""A campaign with its first proposal, and what was recorded there: made once, copied by tests."""

import shutil
from dataclasses import dataclass, replace
from pathlib import Path

from planner.proof.model import Truth
from tests.support.outside import make_cell, record, told


@dataclass(frozen=True)
class FirstPose:
    """A campaign whose simulation does not learn, which is quick, and nine hits at its pose."""

    cell: Path
    robot: Path
    plan: Path
    truth: Truth
    pose: str
    joints_deg: list[float]
    made: Path

    @classmethod
    def begun(cls, root: Path) -> "FirstPose":
        robot, plan, truth = make_cell(root, learns=False)
        told("new", root / "cell", "--robot", robot, "--campaign", plan)
        (proposal,) = told("next", root / "cell")["proposals"]
        pose, joints_deg = proposal["pose"], proposal["joints_deg"]
        made = record(truth, root / "made", pose, joints_deg)
        return cls(root / "cell", robot, plan, truth, pose, joints_deg, made)

    def copied(self, folder: Path, name: str = "cell") -> "FirstPose":
        """The campaign under a name, and its recordings, to be changed."""
        cell = shutil.copytree(self.cell, folder / name)
        return replace(self, cell=cell, made=shutil.copytree(self.made, folder / "made"))

    @property
    def files(self) -> list[Path]:
        """The recorded hits."""
        return sorted((self.made / "data").iterdir())

    def at(self, folder: Path, pose: str, joints_deg: list[float], seed: int = 0) -> Path:
        """What would be recorded at another pose, or again."""
        return record(self.truth, folder, pose, joints_deg, seed)
