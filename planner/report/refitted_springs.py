"""What recordings taught a campaign's simulation of each joint's stiffness, beside robot.toml's."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.table import Table

from planner.report.identification import with_exponent
from planner.report.text import table

if TYPE_CHECKING:
    from planner.campaign.model import Model

COLUMNS = "joint and axis", "stated", "refitted ± sd", "unit", "known"
NOT_KNOWN = (
    "Known, yes: the recordings tell this stiffness; its sd is half of what was assumed before, or "
    "less. No: they tell less, and the value leans on what was assumed, or it is so far from that "
    "that something else may have moved it."
)


@dataclass(frozen=True)
class RefittedSpring:
    """A spring of the simulation as robot.toml states it and as refitted to all recordings.

    `stated` is None for one that robot.toml lacks; `identifiable`: the recordings tell of it.
    """

    joint: str
    axis: tuple[float, ...]
    stated: float | None
    stiffness: float
    stiffness_sd: float
    unit: str
    identifiable: bool

    @property
    def cells(self) -> tuple[str, ...]:
        """A row of the table."""
        letters = [letter for a, letter in zip(self.axis, "xyz", strict=True) if abs(a) == 1]
        axis = letters[0] if letters else " ".join(f"{a:.3g}" for a in self.axis)
        return (
            f"{self.joint} {axis}",
            "not stated" if self.stated is None else with_exponent(self.stated),
            with_exponent(self.stiffness, self.stiffness_sd),
            self.unit,
            "yes" if self.identifiable else "no",
        )


def refitted_springs(model: "Model") -> tuple[RefittedSpring, ...]:
    """One entry for each spring that was fitted; none where the simulation does not learn."""
    learned = model.low.learned
    if learned is None:
        return ()
    blocks, stated = learned.structure.simulation.robot.config.compliance, learned.stated
    told = {
        number: estimate
        for estimate in learned.identified.estimates if estimate.kind == "stiffness"
        for number in estimate.blocks
        if number < stated or estimate in learned.unstated
    }  # fmt: skip
    return tuple(
        RefittedSpring(
            blocks[n].joint, tuple(blocks[n].axis), blocks[n].stiffness if n < stated else None,
            estimate.value, estimate.sd, estimate.unit, estimate.identifiable,
        )
        for n, estimate in sorted(told.items())
    )  # fmt: skip


def springs_table(springs: tuple[RefittedSpring, ...]) -> Table:
    """Spring by spring."""
    made = table("Stiffnesses of the simulation, refitted to all recordings", *COLUMNS)
    for spring in springs:
        made.add_row(*spring.cells)
    return made
