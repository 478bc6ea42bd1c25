"""Screens on concealed cases: what they say of a case's folder, beside its answer."""

import json
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from planner.dataset.dataset import Dataset
from planner.diagnosis.screens import screen as screens
from planner.dynamics.simulation import Simulation
from planner.robot.robot import Robot

OWN = (
    "sensor_rotation", "sensor_gain", "polarity", "channel_delay", "exponential_window", "drift",
    "friction", "backlash", "nonlinear_stiffness",
)  # fmt: skip
# Names of the same number here and in the answers.
SAME = {
    "gain": "gain", "delay": "delay_s", "time_constant": "time_constant_s", "angle": "angle_rad",
    "change": "change", "stiffness_change": "stiffness_change", "half_gap": "half_gap_rad",
    "presliding_stiffness": "presliding_stiffness", "coulomb_torque": "coulomb_torque",
    "lost_stiffness": "lost_stiffness",
}  # fmt: skip


@dataclass(frozen=True)
class Verdict:
    """One case: what was hidden, what was said, (error, sd) of every number, CPU seconds."""

    kind: str
    hidden: tuple
    said: tuple
    errors: dict
    seconds: float

    @property
    def right(self) -> bool:
        """An effect of ours is named with its place; of others at most "unknown" is said."""
        if self.kind in OWN or self.kind == "drives":
            return set(self.said) == set(self.hidden)
        return all(effect == "unknown" for effect, _ in self.said)


def judge(case: Path, answer: str) -> Verdict:
    """Screen a case's folder, then compare with its answer."""
    truth = json.loads(answer)
    nominal = Simulation(Robot.load(case / "robot" / "robot.toml"))
    began = time.process_time()
    band = nominal.robot.config.band_hz
    recorded = Dataset.read(case / "recordings", nominal.robot, band)
    found = screens.screen(recorded, nominal).findings
    seconds = time.process_time() - began
    hidden = tuple((e["effect"], e["at"]) for e in truth["effects"])
    errors = {}
    for finding in found:
        for effect in truth["effects"]:
            if (finding.effect, finding.at) == (effect["effect"], effect["at"]):
                for name, (value, sd, _) in finding.parameters.items():
                    true = effect["parameters"].get(SAME.get(name, ""))
                    if true is not None:
                        errors[name] = value - true, sd, true
    said = tuple((f.effect, f.at) for f in found)
    return Verdict(truth["kind"], hidden, said, errors, seconds)


def table(verdicts: list[Verdict]) -> str:
    """Right and wrong by kind, coverage of 90 % intervals by number, seconds a case."""
    lines = ["kind                          cases  right  said otherwise"]
    for kind in dict.fromkeys(v.kind for v in verdicts):
        group = [v for v in verdicts if v.kind == kind]
        wrong = Counter(str(v.said) for v in group if not v.right)
        told = "; ".join(f"{n} × {what}" for what, n in wrong.items())
        lines.append(f"{kind:<30}{len(group):5d}{sum(v.right for v in group):7d}  {told}")
    inside: dict[str, list[bool]] = {}
    for v in verdicts:
        for name, (error, sd, _) in v.errors.items():
            inside.setdefault(name, []).append(abs(error) <= 1.645 * sd)
    for name, each in inside.items():
        lines.append(f"90 % interval of {name:<22} covers {sum(each)} of {len(each)}")
    mean = sum(v.seconds for v in verdicts) / max(len(verdicts), 1)
    worst = max((v.seconds for v in verdicts), default=0.0)
    lines.append(f"CPU seconds a case: {mean:.1f} (mean), {worst:.1f} (most)")
    return "\n".join(lines)
