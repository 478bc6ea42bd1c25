"""Checks of the elastic part: springs and dampers that cannot be, modes beside the band."""

from collections.abc import Iterator

import numpy as np

from planner.check.description import CheckRemark
from planner.dynamics.simulation import Simulation
from planner.robot.config import BASE, Compliance

# By which a stiffness in another unit is told: each spring alone, with the inertia that it moves.
# Springs of the arms in campaigns/ lie between 5 and 500 Hz.
SLOWEST_HZ, FASTEST_HZ = 1.0, 1e4
SAG_M = 0.02
SAG_RAD, FALLS_RAD = 0.02, 0.5  # under its own weight: what a spring may give, what none can carry
# Damping ratio of one spring alone; published fits have up to 3.5 at a wrist's last joint.
RATIO, USUAL_RATIO = 5.0, 0.02
SPARE_HZ = 0.5  # a band that begins this near to a mode cuts its peak


def check_springs(simulation: Simulation, q: np.ndarray) -> list[CheckRemark]:
    """What looks wrong in [[compliance]], seen from poses q (n, dof) in rad."""
    robot, blocks = simulation.robot, simulation.robot.config.compliance
    unstable = _unstable(simulation, q)
    if unstable:
        return [unstable]
    e, sag, found = len(blocks), np.abs(simulation.elastic.sag(q)).max(axis=0), []
    matrices = simulation.elastic.matrices(q)
    inertia = np.diagonal(matrices.mass, axis1=1, axis2=2).mean(axis=0)[:e]
    for i, block in enumerate(blocks):
        where = f"{robot.path.name}, [[compliance]] number {i + 1} ({block.joint})"
        found += _spring(block, float(inertia[i]), where)
        if sag[i] > (SAG_M if block.slide else SAG_RAD):
            size = f"{1e3 * sag[i]:.2g} mm" if block.slide else f"{np.rad2deg(sag[i]):.2g}°"
            text = f"It gives by {size} under the robot's own weight."
            remedy = "Stiffnesses are in N·m/rad, neither in kN·m/rad nor in N·m/degree."
            if block.slide:
                remedy = "Stiffnesses along an axis are in N/m, neither in kN/m nor in N/mm."
            found.append(CheckRemark("warning", text, where, remedy))
    return [*found, *_own_axes(simulation)]


def _unstable(simulation: Simulation, q: np.ndarray) -> CheckRemark | None:
    """Springs that do not carry the robot's weight: nothing else can be computed then."""
    robot, blocks = simulation.robot, simulation.robot.config.compliance
    file = robot.path.name
    try:
        sag = np.abs(simulation.elastic.sag(q))
        whole = simulation.stiffness.real + simulation.elastic.matrices(q).geometric
        least = np.linalg.eigvalsh(whole).min() if np.isfinite(whole).all() else -np.inf
        modes = simulation.frequencies(q, 1).frequency_hz
        worst = int(np.argmax(np.nan_to_num(sag, nan=np.inf).max(axis=0)))
    except np.linalg.LinAlgError:
        text = "No modes come out: masses and stiffnesses are too far apart to compute with."
        return CheckRemark("error", text, file, "Correct the units of [[compliance]].")
    if not np.isfinite(modes).any():
        text = "No mode oscillates: all are overdamped, or the springs are too soft."
        return CheckRemark("error", text, file, "Correct stiffness (N·m/rad) and damping.")
    angle = np.nan_to_num(sag[:, worst], nan=np.inf).max()
    if least > 0 and angle < FALLS_RAD:
        return None
    name, stiffness, unit = "resonator", 0.0, "N·m/rad"
    if worst < len(blocks):
        block = blocks[worst]
        name, stiffness = block.joint, block.stiffness
        unit = "N/m" if block.slide else unit
    return CheckRemark(
        "error",
        f"The robot falls over: the spring of {stiffness:.4g} {unit} does not carry the weight "
        f"outboard of it.",
        f"{file}, [[compliance]] number {worst + 1} ({name})",
        f"State the stiffness in {unit}, and masses in kg.",
    )


def _spring(block: Compliance, inertia: float, where: str) -> Iterator[CheckRemark]:
    """One spring with what it moves, `inertia` in kg·m² (kg where it slides)."""
    rate = float(np.sqrt(block.stiffness / inertia))
    unit, moves = ("N/m", "kg") if block.slide else ("N·m/rad", "kg·m²")
    swings = f"it swings at {rate / 2 / np.pi:.3g} Hz"
    alone = f"alone, with the {inertia:.3g} {moves} that it moves, {swings}"
    given = f"A stiffness of {block.stiffness:.4g} {unit}"
    if rate < 2 * np.pi * SLOWEST_HZ:
        text = f"{given} is hardly any: {alone}."
        yield CheckRemark("warning", text, where, f"Stiffnesses are in {unit}.")
    elif rate > 2 * np.pi * FASTEST_HZ:
        remedy = f"Stiffnesses are in {unit}; leave out what does not give."
        yield CheckRemark("warning", f"{given} is as good as rigid: {alone}.", where, remedy)
    ratio = block.damping / (2 * inertia * rate)
    unit = "N·s/m" if block.slide else "N·m·s/rad"
    if ratio > RATIO:
        text = f"Its damper of {block.damping:.4g} has a damping ratio of {ratio:.2g}."
        remedy = f"Dampers are in {unit}; a ratio of 0.01 to 0.1 is usual."
        yield CheckRemark("warning", text, where, remedy)
    elif block.damping == 0 and block.loss_factor == 0:
        text = "It has no damping: resonances of simulated FRFs are infinitely high."
        usual = 2 * USUAL_RATIO * inertia * rate
        remedy = f"A damping ratio of 0.01 to 0.05 is usual, here some {usual:.2g} {unit}."
        yield CheckRemark("warning", text, where, remedy)


def _own_axes(simulation: Simulation) -> Iterator[CheckRemark]:
    """Joints whose own axis is rigid, though gears are what gives most."""
    robot = simulation.robot
    given = {block.joint for block in robot.config.compliance if robot.is_own(block)}
    rigid = [name for name in robot.joint_names if name not in given]
    if rigid and len(rigid) < len(robot.joint_names):
        slides = all(robot.slides(name) for name in rigid)
        text = f"Rigid {'along' if slides else 'about'} its own axis: {', '.join(rigid)}."
        remedy = f'Add a [[compliance]] for each that gives; joint = "{BASE}" is for the floor.'
        yield CheckRemark("note", text, f"{robot.path.name}, [[compliance]]", remedy)


def check_band(
    robot_toml: str, frequency_hz: np.ndarray, band_hz: tuple[float, float], count: int | None
) -> Iterator[CheckRemark]:
    """Modes (n, k) in Hz of n poses against a band; `count` of them are asked for (None: any)."""
    (low, high), where = band_hz, f"{robot_toml}, band_hz"
    inside = ((frequency_hz >= low) & (frequency_hz <= high)).sum(axis=1)
    said = f"{low:g} to {high:g} Hz"
    if not inside.any():
        lowest = np.nanmin(frequency_hz)
        text = f"No simulated mode lies in {said}; the lowest is at {lowest:.3g} Hz."
        yield CheckRemark("warning", text, where, "Correct band_hz, stiffnesses or masses.")
        return
    first = np.nanmin(frequency_hz[:, 0])
    if first < low + SPARE_HZ:
        text = f"Mode 1 comes down to {first:.3g} Hz, {said} begins above or beside it."
        remedy = "Begin the band lower, or leave mode 1 out on purpose."
        yield CheckRemark("warning", text, where, remedy)
    if count is not None and inside.min() < count:
        text = f"{count} modes are asked for, but at some poses only {inside.min()} lie in {said}."
        yield CheckRemark("warning", text, where, "Ask for fewer, or widen the band.")
