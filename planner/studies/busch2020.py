"""The study of Busch et al. 2020: one FRF, trained up to 105° of joint 3, predicted up to 120°.

GP, NARGP and MFDGP as published (`published_surface`) see the amplitudes of the driving point, as
in the paper, and so do variants of ours that model their logarithm (`frf_surface`). Fused modes and
the diagnosed simulation see the complex FRFs of the same hits, three responses to each.
"""

import numpy as np

from planner.api import diagnose
from planner.errors import InputError, RefusedError
from planner.progress import Tell, within
from planner.studies.busch2020_data import ACROSS, BAND_HZ, BEYOND_DEG, Sweep, poses, sweep
from planner.studies.busch2020_findings import findings
from planner.studies.busch2020_pictures import experiments, maps, overlays, sd_maps
from planner.studies.busch2020_scores import (
    DIAGNOSED,
    FUSED,
    THIN,
    BeyondPrediction,
    robot_table,
    score_table,
    thin_table,
)
from planner.studies.modal_route import predict_beyond
from planner.studies.models.frf_surface import Grid, fit_surface
from planner.studies.models.published_surface import PUBLISHED, fit_published
from planner.studies.report import Report

LOGARITHMIC = ("log sparse NARGP", "log quadrature MFDGP")
EVERY = (1, 2, 3, 4)  # every n-th experiment is trained with
ROBOTS = (11, 12, 13)  # seeds; ours was written with robots 1 and 2
COARSE = 3  # the small version has every so manyth line and angle of the simulation


def study(progress: Tell, small: bool = False) -> Report:
    """R² beyond 105° of every model, with every, every 2nd, 3rd and 4th experiment."""
    steps, robots = ((4,), ROBOTS[:1]) if small else (EVERY, ROBOTS)
    first = sweep(robots[0], within(progress, 0.0, 0.02))
    predicted = {}
    for i, step in enumerate(steps):
        everything = step == 1
        part = within(progress, 0.02 + 0.7 * i / len(steps), 0.02 + 0.7 * (i + 1) / len(steps))
        predicted[step] = _predict(first.every(step), everything, part, COARSE if small else 1)
    fused = {robots[0]: {step: (predicted[step], first) for step in steps}}
    for i, seed in enumerate(robots[1:]):
        progress(f"robot {seed}", 0.72 + 0.1 * i)
        seen = sweep(seed)
        fused[seed] = {step: (_fused(seen.every(step)), seen) for step in steps}
    main = predicted[steps[0]]
    tables = (
        score_table(main, first.every(steps[0])),
        thin_table(predicted, first),
        robot_table(fused),
    )
    return Report(
        "busch2020",
        "SIMULATED: the published robot in MuJoCo with a swaying dress pack, hit across the arm at "
        "three levels with everyday errors, friction and damping that scatters; its simulation "
        "lacks the dress pack and has nominal stiffnesses."
        + (f" {main.said}" if main.said else ""),
        tables,
        findings(*tables, main),
        {
            "busch2020_maps": maps(main, first),
            "busch2020_sd": sd_maps(main, first.every(steps[0])),
            "busch2020_overlays": overlays(main, first),
            "busch2020_experiments": experiments(tables[1], steps),
        },
    )


def _fused(seen: Sweep) -> BeyondPrediction:
    amplitude, sd = predict_beyond(seen)
    return BeyondPrediction({FUSED: amplitude}, sd)


def _predict(seen: Sweep, everything: bool, progress: Tell, coarse: int = 1) -> BeyondPrediction:
    """By the models that every number of experiments is given, or by all; every so manyth low."""
    lines, angles = seen.simulated_axes
    kept = slice(None, None, coarse), slice(None, None, coarse)
    low = Grid(lines[kept[0]], angles[kept[1]], seen.simulated[kept])
    measured = Grid(seen.lines_hz, seen.angles_deg, seen.amplitude)
    at, count = (seen.lines_hz, BEYOND_DEG), len(seen.angles_deg)
    surface, said = fit_published(low, low, "GP"), ""
    predicted = {"simulation": surface.predict(*at)[0]}
    trained = {"simulation": surface.predict(seen.lines_hz, seen.angles_deg)[0]}
    trained_sd: dict[str, np.ndarray] = {}
    beyond_sd: dict[str, np.ndarray] = {}
    published = tuple(PUBLISHED) if everything else tuple(n for n in PUBLISHED if n in THIN)
    for i, model in enumerate(published):
        progress(f"{model} as published, {count} experiments", 0.3 * i)
        surface = fit_published(measured, low, model)
        predicted[model], beyond_sd[model] = surface.predict(*at)
        trained[model], trained_sd[model] = surface.predict(seen.lines_hz, seen.angles_deg)
    for model in LOGARITHMIC if everything else ():
        progress(f"{model}, {count} experiments", 0.7)
        predicted[model] = fit_surface(measured, low, model).predict(*at)[0]
    progress(f"fused modes, {count} experiments", 0.8)
    fused = _fused(seen)
    predicted |= fused.amplitude
    if everything:
        progress("diagnosis", 0.85)
        predicted[DIAGNOSED], said = _diagnosed(seen)
    return BeyondPrediction(predicted, fused.sd, said, trained, trained_sd, beyond_sd)


def _diagnosed(seen: Sweep) -> tuple[np.ndarray, str]:
    """Amplitudes (f, p) of the simulation with what a diagnosis of the same hits adds to it."""
    try:
        told = diagnose(seen.struck.dataset(BAND_HZ), seen.simulation.robot)
    except (InputError, RefusedError) as error:
        return np.full((len(seen.lines_hz), len(BEYOND_DEG)), np.nan), f"Not diagnosed: {error}"
    found = ", ".join(f"{f.effect} at {f.at} ({f.probability:.2f})" for f in told.findings)
    mean, _ = told.predict(poses(BEYOND_DEG), seen.lines_hz)
    return np.abs(mean[:, ACROSS, ACROSS]).T, f"Diagnosis: {told.verdict}; {found or 'no finding'}."
