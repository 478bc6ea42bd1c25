"""From a source of FRFs and a cut to the answer of `stability`."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.milling.cut import Cut, load_cut
from planner.milling.cutter_frf import CutterFrf, of_accelerance, read_frf
from planner.milling.lobes import Loss, losses
from planner.milling.mode_file import load_mode_file
from planner.milling.point import multiplier
from planner.milling.structure import SAMPLES, Structure, beyond, of_frf, of_modes
from planner.milling.uncertainty import PROBABILITY, SampledLimits, sampled_limits
from planner.progress import Tell, quietly, within
from planner.report.plot_files import Pictures
from planner.report.stability import StabilityReport
from planner.report.text import SIMULATED_TITLE

LOBES_SHARE = 0.2  # of the time, where samples follow


@dataclass(frozen=True)
class Asked:
    """What `stability` is asked: a source, its pose, and one point of interest.

    With `tool` the FRFs are coupled to it first, as `couple` does: `reference` is the tested one,
    `robot` whose simulation tells how the tip turns.
    """

    source: Path
    cut: Path
    pose: str | None = None
    point: str | None = None
    samples: int = SAMPLES
    tool: Path | None = None
    reference: Path | None = None
    robot: Path | None = None


def stability_of(
    asked: Asked, pictures: Pictures | None = None, tell: Tell = quietly
) -> StabilityReport:
    """Raises InputError where source, cut or point are wrong."""
    cut = load_cut(asked.cut)
    point = None if asked.point is None else _point(asked.point)
    structure = structure_of(asked, cut)
    machine, samples = structure.machine(cut), structure.samples(cut, asked.samples)
    found = losses(machine, within(tell, 0.0, LOBES_SHARE if samples else 1.0))
    drawn = None
    if samples:
        drawn = sampled_limits(samples, found, within(tell, LOBES_SHARE, 1.0))
    answer = _answer(cut, structure, found, drawn)
    if point is not None:
        there = multiplier(machine, *point)
        answer = replace(answer, multiplier=there.size, multiplier_error=there.error)
    if pictures is not None and pictures.wanted:
        from planner.report.stability_plot import lobes_figure

        mark = SIMULATED_TITLE if answer.simulated else ""
        figure = lobes_figure(cut, found, drawn, point, mark)
        answer = replace(answer, **pictures.write({"stability": figure}, asked.source.name))
    return answer


def structure_of(asked: Asked, cut: Cut) -> Structure:
    """From modes, FRFs, or a campaign at a pose."""
    source = asked.source
    if asked.tool is not None:
        return _coupled(asked, asked.tool, cut)
    if asked.reference is not None or asked.robot is not None:
        raise InputError("--reference and --robot go with --tool; name the tool that is put on.")
    if source.suffix.lower() == ".toml":
        if asked.pose is not None:
            raise InputError(f"{source} states modes of one pose; leave --pose out.")
        return of_modes(load_mode_file(source), cut)
    if source.is_dir():
        return of_frf(_of_campaign(source, asked.pose), cut)
    return of_frf(read_frf(source, asked.pose), cut)


def _coupled(asked: Asked, tool: Path, cut: Cut) -> Structure:
    from planner.milling.coupling import couple
    from planner.milling.tool import load_tool
    from planner.report.coupling_source import tip_of

    target = load_tool(tool)
    tested = None if asked.reference is None else load_tool(asked.reference)
    tip, pose = tip_of(asked.source, tested, asked.pose, asked.robot, 0.0)
    coupled = couple(tip, target, tested)
    h, sd = coupled.accelerance[:3, :3].copy(), coupled.accelerance_sd[:3, :3]
    unknown = [k for k in range(3) if k not in coupled.kept]
    h[unknown] = h[:, unknown] = np.nan
    frf = of_accelerance(f"{asked.source}, {pose}, {target.name}", coupled.frequency_hz, h, sd)
    structure = of_frf(frf, cut)
    return replace(structure, remarks=(*coupled.remarks, *structure.remarks))


def _of_campaign(directory: Path, pose: str | None) -> CutterFrf:
    from planner.campaign.campaign import Campaign

    campaign = Campaign(directory)
    state = campaign.state
    known = {m.pose: m.joints_deg for m in state.measurements.values()}
    known |= {name: p.joints_deg for name, p in state.proposals.items() if name not in known}
    if pose is None or pose not in known:
        given = f"has no pose {pose}; choose" if pose else "is a campaign: say at which pose,"
        raise InputError(
            f"{directory} {given} one of {', '.join(known) or 'none yet'} with --pose."
        )
    q = np.deg2rad(np.array([known[pose]]))
    mean, sd = campaign.frf(q)
    frf = of_accelerance(f"{directory}, pose {pose}", campaign.frequency_lines, mean[0], sd[0])
    return replace(frf, simulated=any(m.simulated for m in state.recorded))


def _answer(
    cut: Cut, structure: Structure, found: tuple[Loss, ...], drawn: SampledLimits | None
) -> StabilityReport:
    depth = np.array([loss.depth_m for loss in found])
    robust, remarks = depth, list(structure.remarks)
    outside = beyond(structure, np.array([loss.chatter_hz for loss in found]))
    remarks += [outside] if outside else []
    if drawn is not None:
        robust = drawn.robust()
        robust = np.where(np.isfinite(robust), robust, np.nan)
        off = drawn.robust_sd()
        off = off[np.isfinite(off)]
        if off.size:
            remarks.append(
                f"Depths at {100 * PROBABILITY:.0f} % are from {len(drawn.depth_m)} samples, known "
                f"to ± {100 * np.median(off):.1f} % (median over speeds)."
            )
    return StabilityReport(
        spindle_rpm=cut.speeds_rpm,
        depth_limit_m=depth,
        kind=tuple(loss.kind for loss in found),
        chatter_hz=np.array([loss.chatter_hz for loss in found]),
        depth_limit_m_at_95=robust,
        method=cut.method,
        depth_error=np.array([loss.error for loss in found]),
        remarks=tuple(remarks),
        simulated=structure.frf is not None and structure.frf.simulated,
    )


def _point(text: str) -> tuple[float, float]:
    try:
        rpm, depth = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--point {text} is not RPM,DEPTH_M; give e.g. 5000,0.001.") from None
    if not (1 <= rpm <= 1e6 and 0 <= depth < 1):
        raise InputError(f"--point {text}: the speed must be 1 rpm or more, the depth 0 to 1 m.")
    return rpm, depth
