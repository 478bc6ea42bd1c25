"""Answer of `identify`: elastic parameters, what they are worth, and what stays open."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from planner.report.agreement import FrfSimilarity, SimilarityChange
from planner.report.answer import NOT_IN_JSON, Answer, RefusedFile
from planner.report.pictures import Pictures, entitle
from planner.report.text import remarks, table, with_sd

if TYPE_CHECKING:
    from planner.dataset.dataset import Dataset
    from planner.dynamics.simulation import Simulation
    from planner.fit.held_out import JudgedIdentification
    from planner.fit.result import Identification
    from planner.measurement.agreement import Similarity
    from planner.report.frf_plots import ComparedFrfs
    from planner.robot.robot import Robot


@dataclass(frozen=True)
class StatedSpring:
    """Stiffness (N·m/rad) and damping (N·m·s/rad) as robot.toml states them."""

    stiffness: float
    damping: float


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
    nominal: StatedSpring
    unit: str | msgspec.UnsetType = msgspec.UNSET  # of the stiffness of a shift: "N/m"

    @property
    def cells(self) -> tuple[str, ...]:
        """A row of the table."""
        letters = [letter for a, letter in zip(self.axis, "xyz", strict=True) if abs(a) == 1]
        axis = letters[0] if letters else " ".join(f"{a:.3g}" for a in self.axis)
        axis = axis if self.unit is msgspec.UNSET else f"along {axis} (N/m, N·s/m)"
        return (
            f"{self.joint} {axis}",
            _with_sd(self.stiffness, self.stiffness_sd),
            "yes" if self.identifiable else "no",
            _with_sd(self.damping, self.damping_sd),
            "yes" if self.damping_identifiable else "no",
        )


@dataclass(frozen=True, eq=False)
class IdentificationBasis:
    """What an identification was made of, and all that it found."""

    dataset: "Dataset"
    judged: "JudgedIdentification"
    nominal: "Simulation"

    @property
    def fitted(self) -> "Robot":
        """The robot with everything that was fitted, as stated."""
        return self.judged.final.structure.simulation.robot

    def compared(self, band_hz: tuple[float, float]) -> "ComparedFrfs | None":
        """FRFs before and after it, pose by pose; None where the tool was not measured."""
        from planner.measurement.agreement import MODEL_ERROR, MOST_LINES
        from planner.measurement.measured_frfs import stack
        from planner.report.frf_plots import GIVEN, IDENTIFIED, ComparedFrfs, Side

        judged, (aside, trial) = self.judged, (self.judged.held_out, self.judged.trial)
        tools = ((i, frf.of_tool) for i, frf in enumerate(self.dataset.frfs))
        frfs = {i: frf for i, frf in tools if frf is not None}
        if not frfs:
            return None
        seen = stack(list(frfs.values()), band_hz, MOST_LINES, MODEL_ERROR)
        fits = [trial if i in aside and trial else judged.final for i in frfs]
        before, after = (
            np.array([s.accelerance(self.dataset.q[i], hz)[0]
                      for s, i, hz in zip(of_pose, frfs, seen.frequency_hz, strict=True)])
            for of_pose in ([self.nominal for _ in frfs], [f.identified.simulation for f in fits])
        )  # fmt: skip
        sides = (
            Side("before", "as stated", GIVEN, before),
            Side("after", "identified", IDENTIFIED, after),
        )
        return ComparedFrfs(
            tuple(self.dataset.poses[i] for i in frfs),
            seen.frequency_hz,
            np.where(seen.used, seen.accelerance, np.nan),
            sides,
            tuple("held out: identified without it" if i in aside else "used" for i in frfs),
        )


@dataclass(frozen=True, eq=False)
class IdentificationReport(Answer):
    """Answer of `identify`; `misfit` is χ² per value, 1 at the noise.

    `added` are the springs that robot.toml did not have; `basis` holds the fits themselves.
    """

    parameters: tuple[IdentifiedSpring, ...]
    fit: SimilarityChange
    held_out: SimilarityChange
    undetermined: tuple[str, ...]
    misfit: float
    misfit_by_pose: Mapping[str, float]
    converged: bool
    refused: tuple[RefusedFile, ...]
    remarks: tuple[str, ...]
    simulated: bool
    band_hz: tuple[float, float]
    inertias: bool
    added: int
    out: str | None = None
    plots: tuple[str, ...] = ()
    rrd: str | None = None
    urdf: str | msgspec.UnsetType = msgspec.UNSET
    written: FrfSimilarity | msgspec.UnsetType = msgspec.UNSET
    seconds: float = 0.0
    basis: IdentificationBasis | None = field(default=None, repr=False, metadata=NOT_IN_JSON)

    @property
    def simulation(self) -> "Simulation":
        """The identified simulation."""
        assert self.basis is not None
        return self.basis.judged.final.identified.simulation

    def with_pictures(self, pictures: Pictures) -> "IdentificationReport":  # pyright: ignore[reportIncompatibleMethodOverride]
        """The same once FRFs before and after are drawn, where that is wanted."""
        if not pictures.wanted or self.basis is None:
            return self
        compared, more = self.basis.compared(self.band_hz), None
        name = self.basis.nominal.robot.name
        if compared is None:
            return self.with_figures(pictures, dict, name)
        if pictures.rrd is not None:
            from planner.report.rerun.figures import one_by_one

            each = (entitle(f, name, self.simulated) for f in compared.overlays())
            more = one_by_one("pose", "FRFs, pose by pose", each)
        first = sorted(range(len(compared.roles)), key=lambda k: compared.roles[k] == "used")
        note = "Those held out are shown with what was identified without them."
        return self.with_figures(pictures, lambda: compared.figures(first), name, note, more)

    def write(self, robot_toml: Path) -> "IdentificationReport":
        """Write the identified robot, read it again, and say how well that one agrees.

        Raises InputError where the files cannot be written.
        """
        from planner.dynamics.simulation import Simulation
        from planner.fit.write_robot import write_robot
        from planner.measurement.agreement import fit_similarity
        from planner.robot.robot import Robot

        assert self.basis is not None
        basis = self.basis
        made = write_robot(robot_toml, basis.fitted, basis.judged.final.identified)
        again = Simulation(Robot.load(made.robot_toml))
        fit = fit_similarity(again, basis.dataset.frfs, basis.dataset.q, self.band_hz)
        return replace(
            self,
            remarks=(*self.remarks, *made.remarks),
            out=str(made.robot_toml),
            urdf=str(made.urdf),
            written=FrfSimilarity.of(fit),
        )

    def text(self) -> Group:
        """Parameters, what stays open, and the agreement."""
        low, high = self.band_hz
        made = table(
            f"Elastic parameters from {len(self.misfit_by_pose)} poses, {low:g} to {high:g} Hz",
            *("joint and axis", "stiffness (N·m/rad)", "known", "damping (N·m·s/rad)", "known"),
        )
        for spring in self.parameters:
            made.add_row(*spring.cells)
        parts: list[RenderableType] = [made, Text("  known: identified by the recordings.")]
        if self.undetermined:
            parts.append(Text("Not determined by these recordings:"))
            parts += [Text(f"  {text}") for text in self.undetermined]
        parts += [self._agreement(), *remarks(self.remarks)]
        if self.out and isinstance(self.written, FrfSimilarity):
            frac = 100 * (self.written.frac or math.nan)
            parts.append(Text(f"Written: {self.out} (FRAC {frac:.2f} %), {self.urdf}"))
        return Group(*parts, *self.end)

    def _agreement(self) -> RenderableType:
        aside = self.held_out
        made = table(
            f"Agreement of simulated with measured FRFs (misfit {self.misfit:.2f}, 1 at the "
            f"noise; {self.seconds:.1f} s)",
            *("poses", "FRAC before", "FRAC after", "Frobenius before", "Frobenius after"),
        )
        rows = [("all", self.fit)]
        if isinstance(aside.poses, tuple) and aside.poses:
            rows.append((f"held out: {', '.join(aside.poses)}", aside))
        for name, of in rows:
            values = (of.before.frac, of.frac, of.before.frobenius, of.frobenius)
            made.add_row(name, *("–" if v is None else f"{100 * v:.2f} %" for v in values))
        return made


def identification_report(
    basis: IdentificationBasis, band_hz: tuple[float, float], inertias: bool
) -> IdentificationReport:
    """Of an identification that was judged at poses held out."""
    dataset, judged = basis.dataset, basis.judged
    final, names = judged.final.identified, dataset.poses
    aside = tuple(names[i] for i in judged.held_out)
    return IdentificationReport(
        parameters=identified_springs(basis.fitted, final),
        fit=_change(judged.after, judged.before),
        held_out=_change(judged.held_out_after, judged.held_out_before, aside),
        undetermined=final.undetermined,
        misfit=final.misfit,
        misfit_by_pose=dict(zip(names, final.misfit_by_pose, strict=True)),
        converged=final.converged,
        refused=tuple(RefusedFile(*entry) for entry in dataset.refused),
        remarks=(*dataset.remarks, *_doubts(judged)),
        simulated=dataset.simulated,
        band_hz=band_hz,
        inertias=inertias,
        added=judged.final.structure.added,
        basis=basis,
    )


def _change(
    after: "Similarity | None",
    before: "Similarity | None",
    poses: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET,
) -> SimilarityChange:
    found = FrfSimilarity.of(after)
    return SimilarityChange(
        found.frac, found.frobenius, before=FrfSimilarity.of(before), poses=poses
    )


def _doubts(judged: "JudgedIdentification") -> list[str]:
    final = judged.final
    said = [text for text in (final.words, final.scale, final.departures) if text]
    if not final.fits:
        said.append(
            f"Nothing that was tried explains the recordings: {100 * final.posterior.size:.0f} % "
            f"of the FRFs are left. So no spring counts as known; ask `planner diagnose`."
        )
    if not final.identified.converged:
        said.append("The last fit had not come to rest.")
    if not judged.held_out:
        said.append(
            "No pose was held out, so nothing says how good the simulation is elsewhere; record "
            "three poses or more."
        )
    return said


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
        stated = StatedSpring(block.stiffness, block.damping)
        axis = tuple(block.axis)
        unit = "N/m" if block.slide else msgspec.UNSET
        springs.append(IdentifiedSpring(block.joint, axis, nominal=stated, unit=unit, **values))
    return tuple(springs)


def _with_sd(value: float, sd: float | None) -> str:
    return f"{with_exponent(value)} (kept)" if sd is None else with_exponent(value, sd)


def with_exponent(value: float, sd: float | None = None) -> str:
    """A value, and its sd where that is given, both with the exponent of the value."""
    exponent = 0 if 0.1 <= value < 1000 or value == 0 else math.floor(math.log10(value))
    power = f"e{exponent}" if exponent else ""
    scaled = value / 10**exponent
    said = f"{scaled:.3f}" if sd is None else with_sd(scaled, sd / 10**exponent, ".3f")
    return f"{said}{power}"
