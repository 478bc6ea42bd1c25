"""The papers whose studies are done again."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Paper:
    """Where a study's claims come from."""

    authors: str
    year: int
    title: str
    published: str

    @property
    def short(self) -> str:
        """Such as "Busch et al. 2022"."""
        first = self.authors.split(",")[0]
        return f"{first} et al. {self.year}"

    @property
    def citation(self) -> str:
        """Authors, year, title and journal in one line."""
        return f"{self.authors} ({self.year}). {self.title}. {self.published}."


PAPERS = {
    "busch2022": Paper(
        "Busch, Zaeh", 2022,
        "Multi-Fidelity Information Fusion to Model the Position-Dependent Modal Properties of "
        "Milling Robots", "Robotics 11(1), 17",
    ),
    "busch2020": Paper(
        "Busch, Schnoes, Semm, Zaeh, Obst, Hartmann", 2020,
        "Probabilistic information fusion to model the pose-dependent dynamics of milling robots",
        "Production Engineering 14, 435–444",
    ),
    "seyedhosseini2025": Paper(
        "Seyed Hosseini, Hajzargarbashi, Liu", 2025,
        "Vibration Analysis of Robot Manipulators and Gaussian Process Regression for Estimating "
        "Posture-dependent FRF", "École de technologie supérieure, Montreal",
    ),
    "lei2023": Paper(
        "Lei, Hou, Ding", 2023,
        "Prediction of the Posture-Dependent Tool Tip Dynamics in Robotic Milling Based on "
        "Multi-Task Gaussian Process Regressions",
        "Robotics and Computer-Integrated Manufacturing 81",
    ),
    "birk2025": Paper(
        "Birk, Kipfmüller, Kotschenreuther", 2025,
        "Dynamic Modeling and Analysis of Industrial Robots for Enhanced Manufacturing Precision",
        "Actuators 14(7), 311",
    ),
}  # fmt: skip
