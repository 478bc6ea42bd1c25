"""Figure 12 of Busch et al. 2022: FRFs at a pose left out, from the modes of five others."""

from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure

from planner.dynamics.vibration import SimulatedModes
from planner.frf import synthesis
from planner.studies import drawing
from planner.studies.busch2022_data import AnalysedPoses, split
from planner.studies.report import r_squared
from planner.surrogate.frf_bands import frf_moments
from planner.surrogate.modal_surrogate import ModalObservations, fit_surrogate

TARGET_POSE = "A27"  # x 1.175 m, y 1.0 m, z 1.24 m
BAND_HZ = (5.0, 40.0)
PAIRS = ((0, 0), (0, 1), (1, 0), (1, 1))  # (response, hit): xx, xy, yx, yy


@dataclass(frozen=True, eq=False)
class Rebuilt:
    """R² of the four amplitudes, predicted and with the modes measured there, and what is inside.

    `inside` is the share of lines within the 95 % band.
    """

    figure: Figure
    predicted_r2: list[float]
    measured_r2: list[float]
    inside: float


def figure_12(seen: AnalysedPoses) -> Rebuilt:
    """FRFs at a pose put together from modes that five other poses tell."""
    target = seen.poses.index(TARGET_POSE)
    seed = next(s for s in range(100) if target in split(seen.x, s)[1])
    train = split(seen.x, seed)[0][:5]
    there = np.array([target])
    frf = seen.frfs[target]
    assert frf is not None
    lines = (frf.frequency_hz >= BAND_HZ[0]) & (frf.frequency_hz <= BAND_HZ[1])
    hz, measured = frf.frequency_hz[lines], frf.accelerance[..., lines]
    fitted = fit_surrogate(_rows(seen.modes, train, seen.x))
    prediction = fitted.predict(seen.x[there], _simulated(seen.modes.simulated, there))
    mean, sd = (moment[0] for moment in frf_moments(prediction, hz))
    own = _rows(seen.modes, there, seen.x)
    best = synthesis.accelerance(
        hz, synthesis.pole(own.frequency_hz, own.damping_ratio), own.residue
    )[0]
    predicted_r2, best_r2 = (
        [float(r_squared(np.abs(h[i, j]), np.abs(measured[i, j]))) for i, j in PAIRS]
        for h in (mean, best)
    )
    # |δH|² of a complex normal error exceeds 3.0 σ² in 5 % of all cases.
    variance = sd**2 + frf.variance[..., lines]
    inside = [np.abs(mean[i, j] - measured[i, j]) ** 2 < 3.0 * variance[i, j] for i, j in PAIRS]
    figure = _draw(hz, mean, sd, measured)
    return Rebuilt(figure, predicted_r2, best_r2, float(np.mean(inside)))


def _rows(modes: ModalObservations, which: np.ndarray, x: np.ndarray) -> ModalObservations:
    names = ("frequency_hz", "frequency_sd_hz", "damping_ratio", "damping_sd", "residue",
             "residue_sd")  # fmt: skip
    part = {name: getattr(modes, name)[which] for name in names}
    return replace(modes, x=x[which], simulated=_simulated(modes.simulated, which), **part)


def _simulated(modes: SimulatedModes, which: np.ndarray) -> SimulatedModes:
    return SimulatedModes(
        modes.frequency_hz[which], modes.damping_ratio[which], modes.residue[which]
    )


def _draw(hz: np.ndarray, mean: np.ndarray, sd: np.ndarray, measured: np.ndarray) -> Figure:
    title = f"Figure 12: FRFs at {TARGET_POSE}, predicted from five other poses"
    figure = drawing.new((10.0, 6.4), title)
    panels = figure.subplots(2, 2, sharex=True)
    for i, j in PAIRS:
        panel, size, reach = panels[i, j], np.abs(mean[i, j]), 1.96 * sd[i, j]
        title = f"response {'xyz'[i]}, hit {'xyz'[j]}"
        drawing.frf(panel, hz, size, (size - reach, size + reach), title)
        panel.plot(hz, np.abs(measured[i, j]), "k", lw=0.9, label="recorded (simulated)")
    for panel in panels[1]:
        panel.set_xlabel("frequency (Hz)")
    for panel in panels[:, 0]:
        panel.set_ylabel("|H| (m/s²/N)")
    drawing.legend(figure, panels[0, 0])
    return figure
