"""Answer of `identify`: elastic parameters, what they are worth, and what stays open."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import msgspec
import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from planner.errors import RefusedFile
from planner.measurement.agreement import NO_SIMILARITY, Similarity, fit_similarity
from planner.report.answer import NOT_IN_JSON, Answer
from planner.report.pictures import Pictures, entitle
from planner.report.springs import IdentifiedSpring, identified_springs
from planner.report.text import ending, remarks, table

if TYPE_CHECKING:
    from planner.dataset.dataset import Dataset
    from planner.dynamics.simulation import Simulation
    from planner.fit.held_out import JudgedIdentification
    from planner.report.frf_plots import ComparedFrfs


@dataclass(frozen=True, kw_only=True)
class SimilarityChange(Similarity):
    """After an identification, and before it; at `poses` that the fit did not see, or at all."""

    before: Similarity
    poses: tuple[str, ...] | msgspec.UnsetType = msgspec.UNSET

    @classmethod
    def of(cls, after: Similarity | None, before: Similarity | None, **at: Any) -> Self:
        """None where there is no pose to compare at."""
        return cls(**vars(after or NO_SIMILARITY), before=before or NO_SIMILARITY, **at)


@dataclass(frozen=True, eq=False)
class IdentificationReport(Answer):
    """Answer of `identify`; `misfit` is χ² per value, 1 at the noise.

    `added` are the springs that robot.toml did not have; `judged` holds the fits themselves.
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
    dataset: "Dataset" = field(repr=False, metadata=NOT_IN_JSON)
    judged: "JudgedIdentification" = field(repr=False, metadata=NOT_IN_JSON)
    nominal: "Simulation" = field(repr=False, metadata=NOT_IN_JSON)
    out: str | None = None
    plots: tuple[str, ...] = ()
    rrd: str | None = None
    urdf: str | msgspec.UnsetType = msgspec.UNSET
    written: Similarity | msgspec.UnsetType = msgspec.UNSET
    seconds: float = 0.0

    @property
    def simulation(self) -> "Simulation":
        """The identified simulation, with the robot as stated but for what was fitted."""
        return self.judged.final.identified.simulation

    def with_pictures(self, pictures: Pictures) -> "IdentificationReport":
        """The same once FRFs before and after are drawn, where that is wanted."""
        if not pictures.wanted:
            return self
        compared, name, more = self._compared(), self.nominal.robot.name, None
        if compared is None:
            return replace(self, **pictures.write(dict, name, simulated=self.simulated))
        if pictures.rrd is not None:
            from planner.report.rerun.figures import one_by_one

            numbers = range(len(compared.names))
            each = (entitle(compared.overlay(k), name, self.simulated) for k in numbers)
            more = one_by_one("pose", "FRFs, pose by pose", each)
        first = sorted(range(len(compared.roles)), key=lambda k: compared.roles[k] == "used")
        note = "Those held out are shown with what was identified without them."
        given = name, note, more, self.simulated
        return replace(self, **pictures.write(lambda: compared.figures(first), *given))

    def _compared(self) -> "ComparedFrfs | None":
        """FRFs before and after it, pose by pose; None where the tool was not measured."""
        from planner.measurement.agreement import MODEL_ERROR, MOST_LINES
        from planner.measurement.measured_frfs import stack
        from planner.report.frf_plots import GIVEN, IDENTIFIED, ComparedFrfs, Side

        judged, (aside, trial) = self.judged, (self.judged.held_out, self.judged.trial)
        tools = ((i, frf.of_tool) for i, frf in enumerate(self.dataset.frfs))
        frfs = {i: frf for i, frf in tools if frf is not None}
        if not frfs:
            return None
        seen = stack(list(frfs.values()), self.band_hz, MOST_LINES, MODEL_ERROR)
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

    def write(self, robot_toml: Path) -> "IdentificationReport":
        """The robot written, and how well it agrees once read again; InputError where it fails."""
        from planner.dynamics.simulation import Simulation
        from planner.fit.write_robot import write_robot
        from planner.robot.robot import Robot

        made = write_robot(robot_toml, self.simulation.robot, self.judged.final.identified)
        again = Simulation(Robot.load(made.robot_toml))
        fit = fit_similarity(again, self.dataset.frfs, self.dataset.q, self.band_hz)
        return replace(
            self,
            remarks=(*self.remarks, *made.remarks),
            out=str(made.robot_toml),
            urdf=str(made.urdf),
            written=fit,
        )

    def text(self) -> Group:
        """Parameters, what stays open, and the agreement."""
        low, high = self.band_hz
        made = table(
            f"Elastic parameters from {len(self.misfit_by_pose)} poses, {low:g} to {high:g} Hz",
            *("joint and axis", "stiffness (N·m/rad)", "known", "damping (N·m·s/rad)", "known"),
            rows=(spring.cells for spring in self.parameters),
        )
        parts: list[RenderableType] = [made, Text("  known: identified by the recordings.")]
        if self.undetermined:
            parts.append(Text("Not determined by these recordings:"))
            parts += [Text(f"  {text}") for text in self.undetermined]
        parts += [self._agreement(), *remarks(self.remarks)]
        if self.out and isinstance(self.written, Similarity):
            frac = 100 * self.written.frac
            parts.append(Text(f"Written: {self.out} (FRAC {frac:.2f} %), {self.urdf}"))
        return Group(*parts, *ending(vars(self)))

    def _agreement(self) -> RenderableType:
        aside = self.held_out
        made = table(
            f"Agreement of simulated with measured FRFs (mean square residual {self.misfit:.2f} of "
            f"the noise's; {self.seconds:.1f} s)",
            *("poses", "FRAC before", "FRAC after", "Frobenius before", "Frobenius after"),
        )
        rows = [("all", self.fit)]
        if isinstance(aside.poses, tuple) and aside.poses:
            rows.append((f"held out: {', '.join(aside.poses)}", aside))
        for name, of in rows:
            values = (of.before.frac, of.frac, of.before.frobenius, of.frobenius)
            made.add_row(name, *(f"{100 * v:.2f} %" if np.isfinite(v) else "–" for v in values))
        return made


def identification_report(
    dataset: "Dataset", judged: "JudgedIdentification", nominal: "Simulation",
    band_hz: tuple[float, float], inertias: bool,
) -> IdentificationReport:  # fmt: skip
    """Of an identification that was judged at poses held out."""
    final, names = judged.final.identified, dataset.poses
    aside = tuple(names[i] for i in judged.held_out)
    return IdentificationReport(
        parameters=identified_springs(final.simulation.robot, final),
        fit=SimilarityChange.of(judged.after, judged.before),
        held_out=SimilarityChange.of(judged.held_out_after, judged.held_out_before, poses=aside),
        undetermined=final.undetermined,
        misfit=final.misfit,
        misfit_by_pose=dict(zip(names, final.misfit_by_pose, strict=True)),
        converged=final.converged,
        refused=tuple(RefusedFile(*entry) for entry in dataset.refused),
        remarks=(*dataset.remarks, *_doubts(judged)),
        simulated=dataset.simulated,
        band_hz=band_hz,
        inertias=inertias,
        added=judged.final.added,
        dataset=dataset,
        judged=judged,
        nominal=nominal,
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
