"""The study of Busch et al. 2020: one FRF, trained up to 105° of joint 3, predicted up to 120°.

GP, NARGP and MFDGP as published (`planner.surrogate.models`) see the amplitudes of the driving
point, as in the paper, and so do variants of ours that model their logarithm. Fused modes and the
diagnosed simulation see the complex FRFs of the same hits, three responses to each: to a surface of
amplitudes a moving peak is one that ends and one that begins; to its mode it is a frequency that
changes smoothly, and that the simulation follows.
"""

import numpy as np

from planner.api import diagnose
from planner.campaign import labels
from planner.errors import InputError, RefusedError
from planner.modal.tracking import Guide, track
from planner.progress import ProgressCallback, no_progress, part_of
from planner.studies.claims import Bound, ClaimRule, gathered
from planner.studies.report import Paper, Report, Table, on_each
from planner.surrogate.frf_bands import frf_moments
from planner.surrogate.modal_surrogate import fit_surrogate
from planner.surrogate.models.frf_surface import SURFACES, Grid, Surface, fit_surface

from . import pictures
from .data import ACROSS, BAND_HZ, BEYOND_DEG, LACKS, SWEEP_DEG, Sweep, poses, sweep
from .pictures import DIAGNOSED, FUSED, THIN, BeyondPrediction, Effects, inside, scores

PAPER = Paper(
    "Busch, Schnoes, Semm, Zaeh, Obst, Hartmann", 2020,
    "Probabilistic information fusion to model the pose-dependent dynamics of milling robots",
    "Production Engineering 14, 435–444",
)  # fmt: skip
LOGARITHMIC = ("NARGP", "MFDGP")
EVERY = (1, 2, 3, 4)  # every n-th experiment is trained with
FEWEST_STEP = 3  # every third experiment: 9 of 26 in the paper
ROBOTS = (11, 12, 13)  # seeds; ours was written with robots 1 and 2
ALL_MODELS = 2  # so many of them with every model, the others with fused modes
COARSE = 3  # the small version has every so manyth line and angle of the simulation
EXTRA_MODES = 2  # simulated, beyond those in the band, which a measured one may be instead
NAMED = "effects that the diagnosis names"
RULES = (
    ClaimRule(
        "The simulation alone, which lacks a mode, predicts the FRF poorly.",
        Bound("R² of the simulation beyond 105°", below=0.5, paper=0.353),
    ),
    ClaimRule(
        "Over training and test data GP, MFDGP and NARGP all reach R² above 0.9.",
        Bound("R² of GP over both", above=0.9, paper=0.943),
        Bound("R² of MFDGP over both", above=0.9, paper=0.932),
        Bound("R² of NARGP over both", above=0.9, paper=0.992),
    ),
    ClaimRule(
        "NARGP extrapolates where GP and MFDGP do not.",
        Bound("R² of NARGP beyond 105°", above=0.9, paper=0.982),
        Bound("R² of NARGP over GP's", above=0, paper=0.197),
        Bound("R² of NARGP over MFDGP's", above=0, paper=0.224),
    ),
    ClaimRule(
        "GP and MFDGP say so: their sd grows from the end of the training on.",
        Bound("GP's sd at 120° over that in the training", above=1, full=2, paper="grows (Fig. 8)"),
        Bound("MFDGP's sd at 120° over that in the training", above=1, full=2),
    ),
    ClaimRule(
        "NARGP stays accurate with fewer experiments (9 of 26).",
        Bound("least R² of NARGP with every 1st to 3rd experiment", above=0.9,
              paper="highly accurate (Fig. 10)"),
    ),
    ClaimRule(
        "Fused modes extrapolate to R² ≥ 0.9, with every 4th experiment too.",
        Bound("least R² of fused modes over all steps", above=0.9),
        ours=True,
    ),
    ClaimRule(
        "The diagnosis names what the simulation lacks, a dress pack that swings on link 3.",
        Bound("times that the dress pack is named", above=0),
        Bound("other effects that the diagnosis names", below=1),
        ours=True,
    ),
    ClaimRule(
        "The diagnosed simulation extrapolates better than NARGP, with what the diagnosis adds.",
        Bound("R² of the diagnosed simulation over NARGP's", above=0),
        given=(Bound(NAMED, above=0),),
        ours=True,
    ),
)  # fmt: skip


def study(progress: ProgressCallback, small: bool = False) -> Report:
    """R² beyond 105° of every model, with every, every 2nd, 3rd and 4th experiment."""
    steps, robots = ((4,), ROBOTS[:1]) if small else (EVERY, ROBOTS)

    def run(seed: int, part: ProgressCallback) -> tuple[Sweep, dict[int, BeyondPrediction]]:
        there, i = sweep(seed, part_of(part, 0.0, 0.05)), robots.index(seed)
        if i < ALL_MODELS:
            return there, _all_models(there, steps, i == 0, small, part_of(part, 0.05, 1.0))
        return there, {step: _fused(there.every(step)) for step in steps}

    done = dict(zip(robots, on_each(robots, run, progress), strict=True))
    seen = {seed: there for seed, (there, _) in done.items()}
    runs = {seed: told for seed, (_, told) in done.items()}
    first, sweep_1 = runs[robots[0]], seen[robots[0]]
    main, trained = first[steps[0]], sweep_1.every(steps[0])
    each = [figures(runs[s], seen[s]) for s in robots]
    thin = pictures.thin_table(first, sweep_1)
    return Report(
        "SIMULATED: the published robot in MuJoCo with a swaying dress pack, hit across the arm at "
        "three levels with everyday errors, friction and damping that scatters; its simulation "
        "lacks the dress pack and has nominal stiffnesses."
        + (f" {main.said}" if main.said else "")
        + f" Robots: {len(robots)}, of which {min(ALL_MODELS, len(robots))} with every model.",
        (pictures.score_table(main, trained), thin, _robot_table(runs, seen)),
        each,
        _notes(gathered(each), runs, main),
        {
            "busch2020_maps": pictures.maps(main, sweep_1),
            "busch2020_sd": pictures.sd_maps(main, trained),
            "busch2020_overlays": pictures.overlays(main, sweep_1),
            "busch2020_experiments": pictures.experiments(thin, steps),
        },
    )


def _all_models(
    seen: Sweep, steps: tuple[int, ...], ours: bool, small: bool, progress: ProgressCallback
) -> dict[int, BeyondPrediction]:
    """By step; with every experiment also MFDGP and the diagnosis, and `ours` of the logarithm."""
    done = {}
    for i, step in enumerate(steps):
        part = part_of(progress, i / len(steps), (i + 1) / len(steps))
        done[step] = _predict(seen.every(step), step == 1, ours, part, COARSE if small else 1)
    return done


def figures(run: dict[int, BeyondPrediction], seen: Sweep) -> dict[str, float]:
    """What RULES stand on, of one robot; what was not computed is left out."""
    r2 = {step: {n: scores(a, seen)[0] for n, a in one.amplitude.items()}
          for step, one in run.items()}  # fmt: skip
    step = next(iter(run))
    main, there = run[step], seen.every(step)
    found = {"least R² of fused modes over all steps": min(each[FUSED] for each in r2.values())}
    for name in r2[step].keys() & set(SURFACES):
        found[f"R² of {name} over both"] = pictures.everywhere(name, main, there)
        sd = main.whole[name][1]
        grown = sd[:, -1].mean() / sd[:, : len(there.angles_deg)].mean()
        found[f"{name}'s sd at 120° over that in the training"] = float(grown)
    if "NARGP" not in r2[step]:
        return found
    nargp = r2[step]["NARGP"]
    found["R² of the simulation beyond 105°"] = r2[step]["simulation"]
    found["R² of NARGP beyond 105°"] = nargp
    for name in ("GP", "MFDGP"):
        found[f"R² of NARGP over {name}'s"] = nargp - r2[step].get(name, np.nan)
    if step == 1:  # small: every 4th experiment alone
        found["least R² of NARGP with every 1st to 3rd experiment"] = min(
            each["NARGP"] for step, each in r2.items() if step <= FEWEST_STEP
        )
    if DIAGNOSED in r2[step]:
        right = sum(effect == LACKS for effect in main.named)
        found[NAMED] = len(main.named)
        found["times that the dress pack is named"] = right
        found["other effects that the diagnosis names"] = len(main.named) - right
        found["R² of the diagnosed simulation over NARGP's"] = r2[step][DIAGNOSED] - nargp
    return found


def _notes(
    together: dict[str, list[float]], runs: dict[int, dict[int, BeyondPrediction]],
    main: BeyondPrediction,
) -> dict[str, str]:  # fmt: skip
    fused = min(together["least R² of fused modes over all steps"])
    said = " ".join(one[1].said for one in runs.values() if 1 in one and one[1].said)
    told = {
        "R² of NARGP beyond 105°": "the greatest likelihood of the training need not extrapolate; "
        f"modes fused over the same simulation reach {fused:.3f} at least",
        "least R² of NARGP with every 1st to 3rd experiment": "more experiments do not help where "
        "the kernel cannot carry a peak on",
    } | dict.fromkeys((NAMED, "times that the dress pack is named"), said)
    if all(1 in run for run in runs.values()):
        return told
    names = [name for rule in RULES for name in rule.figures]
    absent = [n for n in names if not np.isfinite(together.get(n, [np.nan])).all()]
    return told | dict.fromkeys(absent, "the small study leaves it out")


def _robot_table(runs: dict[int, dict[int, BeyondPrediction]], seen: dict[int, Sweep]) -> Table:
    """R² of fused modes on each robot, and how often its band holds."""
    rows = []
    for seed, run in runs.items():
        r2 = [scores(each.amplitude[FUSED], seen[seed])[0] for each in run.values()]
        held = [100 * inside(each, seen[seed]) for each in run.values()]
        rows.append((f"robot {seed}", *r2, float(np.mean(held))))
    columns = "", *(f"every {s}" for s in next(iter(runs.values()))), "inside the 95 % band, %"
    return Table("busch2020_robots", "R² of fused modes, robot by robot, every n-th experiment",
                 columns, tuple(rows))  # fmt: skip


def _fused(seen: Sweep) -> BeyondPrediction:
    amplitude, sd = predict_beyond(seen)
    return BeyondPrediction({FUSED: amplitude}, sd)


def _predict(
    seen: Sweep, everything: bool, ours: bool, progress: ProgressCallback, coarse: int = 1
) -> BeyondPrediction:
    """By the models that every number of experiments is given, or by all; every so manyth low."""
    lines, angles = seen.simulated_axes
    low = Grid(lines[::coarse], angles[::coarse], seen.simulated[::coarse, ::coarse])
    measured = Grid(seen.lines_hz, seen.angles_deg, seen.amplitude)
    at, count = (seen.lines_hz, BEYOND_DEG), len(seen.angles_deg)

    def everywhere(surface: Surface) -> np.ndarray:
        """Mean and sd (2, f, n + p) at the measured angles and beyond."""
        trained = surface.predict(seen.lines_hz, seen.angles_deg)
        return np.concatenate([trained, surface.predict(*at)], axis=2)

    whole = {"simulation": everywhere(fit_surface(low, low, "GP"))}
    published = tuple(SURFACES) if everything else tuple(n for n in SURFACES if n in THIN)
    for i, model in enumerate(published):
        progress(f"{model} as published, {count} experiments", 0.3 * i)
        whole[model] = everywhere(fit_surface(measured, low, model))
    predicted = {name: told[0, :, count:] for name, told in whole.items()}
    for model in LOGARITHMIC if everything and ours else ():
        progress(f"{model}, {count} experiments", 0.7)
        log = fit_surface(measured, low, model, logarithm=True)
        predicted[f"log {model}"] = log.predict(*at)[0]
    progress(f"fused modes, {count} experiments", 0.8)
    fused = _fused(seen)
    predicted |= fused.amplitude
    said, named = "", ()
    if everything:
        progress("diagnosis", 0.85)
        predicted[DIAGNOSED], said, named = _diagnosed(seen)
    return BeyondPrediction(predicted, fused.sd, said, whole, named)


def _diagnosed(seen: Sweep) -> tuple[np.ndarray, str, Effects]:
    """Amplitudes (f, p) of the simulation with what a diagnosis of the same hits adds to it."""
    try:
        told = diagnose(seen.hit_poses.dataset(BAND_HZ), seen.simulation.robot)
    except (InputError, RefusedError) as error:
        nothing = np.full((len(seen.lines_hz), len(BEYOND_DEG)), np.nan)
        return nothing, f"Not diagnosed: {error}", ()
    found = ", ".join(f"{f.effect} at {f.at} ({f.probability:.2f})" for f in told.findings)
    mean, _ = told.predict(poses(BEYOND_DEG), seen.lines_hz)
    said = f"Diagnosis: {told.verdict}; {found or 'no finding'}."
    named = tuple((f.effect, f.at) for f in told.findings)
    return np.abs(mean[:, ACROSS, ACROSS]).T, said, named


def predict_beyond(seen: Sweep) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude and sd (f, p) at BEYOND_DEG in m/s²/N, from the modes of what was measured."""
    modes, _ = seen.hit_poses.modes(BAND_HZ, no_progress)
    count = max(len(each) for each in modes)
    guide = seen.modes(seen.angles_deg, count + EXTRA_MODES)
    x = _scaled(seen.angles_deg)
    tracks = track(modes, Guide(guide.frequency_hz, guide.shape), x, ordered=True)
    fitted = fit_surrogate(labels.gathered(x, tracks.modes, seen.modes(seen.angles_deg, count)))
    prediction = fitted.predict(_scaled(BEYOND_DEG), seen.modes(BEYOND_DEG, count))
    mean, sd = frf_moments(prediction, seen.lines_hz)
    return np.abs(mean[:, ACROSS, ACROSS]).T, sd[:, ACROSS, ACROSS].T


def _scaled(angles_deg: np.ndarray) -> np.ndarray:
    return (angles_deg[:, None] - SWEEP_DEG[0]) / (SWEEP_DEG[1] - SWEEP_DEG[0])
