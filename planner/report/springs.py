"""Springs in answers: as identified, and as a campaign's simulation has them, by robot.toml's."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import msgspec

from planner.words import with_sd

if TYPE_CHECKING:
    from planner.campaign.model import Model
    from planner.fit.result import Identification
    from planner.robot.robot import Robot

COLUMNS = "joint and axis", "stated", "refitted ± sd", "unit", "known"
MASS_COLUMNS = "link", "stated ± sd (kg)", "refitted ± sd (kg)"
NOT_KNOWN = (
    "Known, yes: the recordings determine it (sd at most half of the tolerance of robot.toml). No: "
    "they say little of it, and robot.toml's value stands; or it is so far off that another effect "
    "may have moved it."
)


@dataclass(frozen=True)
class IdentifiedSpring:
    """A [[compliance]] block with its identified values; `identifiable` is the stiffness's.

    A value whose sd is None was not fitted. With `unit` "N/m" it is a shift along the axis.
    """

    joint: str
    axis: tuple[float, ...]
    stiffness: float
    stiffness_sd: float | None
    identifiable: bool
    damping: float
    damping_sd: float | None
    damping_identifiable: bool
    loss_factor: float
    loss_factor_sd: float | None
    loss_factor_identifiable: bool
    nominal: Mapping[str, float]  # stiffness and damping as robot.toml states them
    unit: str | msgspec.UnsetType = msgspec.UNSET  # of the stiffness of a shift: "N/m"

    @property
    def cells(self) -> tuple[str, ...]:
        """A row of the table."""
        axis = _axis(self.axis)
        axis = axis if self.unit is msgspec.UNSET else f"along {axis} (N/m, N·s/m)"
        return (
            f"{self.joint} {axis}",
            _fitted(self.stiffness, self.stiffness_sd),
            "yes" if self.identifiable else "no",
            _fitted(self.damping, self.damping_sd),
            "yes" if self.damping_identifiable else "no",
        )


def refitted_springs(model: "Model") -> list[dict[str, Any]]:
    """Springs that were fitted, as robot.toml states them and as refitted to all recordings.

    "stated" is None for one that robot.toml lacks; "identifiable": the recordings tell of it. None
    where the simulation does not learn.
    """
    fit = model.low.identified_robot
    if fit is None:
        return []
    blocks, stated = fit.identified.simulation.robot.config.compliance, fit.stated
    told = {
        number: estimate
        for estimate in fit.identified.estimates if estimate.kind == "stiffness"
        for number in estimate.blocks
        if number < stated or estimate in fit.unstated
    }  # fmt: skip
    return [
        {"joint": blocks[n].joint, "axis": tuple(blocks[n].axis),
         "stated": blocks[n].stiffness if n < stated else None, "stiffness": estimate.value,
         "stiffness_sd": estimate.sd, "unit": estimate.unit, "identifiable": estimate.identifiable}
        for n, estimate in sorted(told.items())
    ]  # fmt: skip


def spring_cells(spring: Mapping[str, Any]) -> tuple[str, ...]:
    """A row of a table of COLUMNS."""
    stated = spring["stated"]
    return (
        f"{spring['joint']} {_axis(spring['axis'])}",
        "not stated" if stated is None else with_sd(stated, None),
        with_sd(spring["stiffness"], spring["stiffness_sd"]),
        spring["unit"],
        "yes" if spring["identifiable"] else "no",
    )


def refitted_masses(model: "Model") -> list[dict[str, Any]]:
    """Of links whose masses the recordings tell, with what is mounted on them, and sds.

    None where the simulation does not learn.
    """
    from planner.fit.departures import known_masses  # status needs none of what it imports

    fit = model.low.identified_robot
    return [
        {"link": m.link, "stated_kg": m.stated_kg, "stated_sd_kg": m.sd_kg,
         "mass_kg": m.stated_kg + m.more_kg, "mass_sd_kg": left_kg}
        for m, left_kg in (known_masses(fit.posterior) if fit else ())
    ]  # fmt: skip


def mass_cells(mass: Mapping[str, Any]) -> tuple[str, str, str]:
    """A row of a table of MASS_COLUMNS."""
    stated = with_sd(mass["stated_kg"], mass["stated_sd_kg"])
    return mass["link"], stated, with_sd(mass["mass_kg"], mass["mass_sd_kg"])


def identified_springs(robot: "Robot", found: "Identification") -> tuple[IdentifiedSpring, ...]:
    """One entry per [[compliance]] block, in its order."""
    by_block = {(e.kind, number): e for e in found.estimates for number in e.blocks}
    springs = []
    for number, block in enumerate(robot.config.compliance):
        values: dict[str, Any] = {}
        for kind in ("stiffness", "damping", "loss_factor"):
            estimate = by_block.get((kind, number))
            values[kind] = getattr(block, kind) if estimate is None else estimate.value
            values[f"{kind}_sd"] = None if estimate is None else estimate.sd
            told = estimate is not None and estimate.identifiable
            values["identifiable" if kind == "stiffness" else f"{kind}_identifiable"] = told
        stated = {"stiffness": block.stiffness, "damping": block.damping}
        axis = tuple(block.axis)
        unit = "N/m" if block.slide else msgspec.UNSET
        springs.append(IdentifiedSpring(block.joint, axis, nominal=stated, unit=unit, **values))
    return tuple(springs)


def _fitted(value: float, sd: float | None) -> str:
    return f"{with_sd(value, sd)}{' (kept)' if sd is None else ''}"


def _axis(axis: tuple[float, ...]) -> str:
    """By its letter, where it is one of x, y, z."""
    letters = [letter for a, letter in zip(axis, "xyz", strict=True) if abs(a) == 1]
    return letters[0] if letters else " ".join(f"{a:.3g}" for a in axis)
