"""From a source of FRFs and a cut to the answer of `stability`."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.milling.cut import load_cut
from planner.milling.directional import Coefficients
from planner.milling.lobes import losses
from planner.milling.machine import Machine
from planner.milling.mode_file import load_mode_file
from planner.milling.point import multiplier
from planner.report.stability import StabilityReport


def stability_of(source: Path, cut_toml: Path, point: str | None) -> StabilityReport:
    """Raises InputError where source, cut or point are wrong."""
    cut = load_cut(cut_toml)
    asked = None if point is None else _point(point)
    machine = Machine(load_mode_file(source).modes.in_plane(cut.plane), cut, Coefficients.of(cut))
    found = losses(machine)
    depth = np.array([loss.depth_m for loss in found])
    answer = StabilityReport(
        spindle_rpm=cut.speeds_rpm,
        depth_limit_m=depth,
        kind=tuple(loss.kind for loss in found),
        chatter_hz=np.array([loss.chatter_hz for loss in found]),
        depth_limit_m_at_95=depth,
        method=cut.method,
        depth_error=np.array([loss.error for loss in found]),
    )
    if asked is None:
        return answer
    there = multiplier(machine, *asked)
    return replace(answer, multiplier=there.size, multiplier_error=there.error)


def _point(text: str) -> tuple[float, float]:
    try:
        rpm, depth = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--point {text} is not RPM,DEPTH_M; give e.g. 5000,0.001.") from None
    if not (np.isfinite(rpm) and rpm > 0 and 0 <= depth < 1):
        raise InputError(f"--point {text}: the speed must be above 0 rpm, the depth 0 to 1 m.")
    return rpm, depth
