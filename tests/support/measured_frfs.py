"""FRFs that the other engine (MuJoCo) would measure, and the KR10 of Birk et al. 2025."""

from pathlib import Path

import numpy as np

from planner.frf.frf import Frf
from planner.proof.arms import KR10
from planner.proof.model import Truth
from tests.support.studied import part

FITS = part("birk2025", "fits")
DEGREE = FITS.DEGREE

# Birk et al. 2025, Table 7: N·m/°, N·m/(°/s).
TORSION = (881.7, 1503.8, 896.7, 600.8, 208.8, 409.6)
TORSION_DAMPING = (0.316, 0.457, 0.468, 0.045, 0.01, 0.233)
TRANSVERSE = (5500.9, 22403.9, 10884.6, 10358.5, 6176.4, 5528.6)
TRANSVERSE_DAMPING = (0.204, 0.029, 0.235, 0.118, 0.154, 0.178)


def birk_folder(folder: Path, transverse: bool = True) -> Path:
    """robot.toml with 24 parameters (both transverse rotations of a joint tied), or 12."""
    path = KR10.write(folder)
    lines = [
        'name = "KR10, Birk et al. 2025"\nurdf = "robot.urdf"\nband_hz = [5.0, 200.0]',
        'tcp_frame = "tcp"\nsensor_frame = "sensor"',
    ]
    for i in range(6):
        lines.append(_block(i, (0, 0, 1), TORSION[i], TORSION_DAMPING[i]))
        for axis in ((1, 0, 0), (0, 1, 0)) if transverse else ():
            block = _block(i, axis, TRANSVERSE[i], TRANSVERSE_DAMPING[i])
            lines.append(f'{block}tie = "transverse_{i + 1}"\n')
    path.write_text("\n".join(lines))
    return path


def _block(i: int, axis: tuple[int, int, int], stiffness: float, damping: float) -> str:
    return (
        f'[[compliance]]\njoint = "joint_{i + 1}"\naxis = {list(axis)}\n'
        f"stiffness = {stiffness * DEGREE}\ndamping = {damping * DEGREE}\n"
    )


def birk_bounds(transverse: bool = True) -> dict[str, tuple[float, float]]:
    """Table 2 in N·m/rad and N·m·s/rad, by parameter."""
    bounds = {}
    for i in range(6):
        places = [(f"joint_{i + 1} about z", FITS.TORSION_BOUNDS[i])]
        places += [(f"transverse_{i + 1}", FITS.TRANSVERSE_BOUNDS[i])] if transverse else []
        for place, (low, high) in places:
            bounds[f"stiffness of {place}"] = (low * DEGREE, high * DEGREE)
            bounds[f"damping of {place}"] = tuple(DEGREE * b for b in FITS.DAMPING_BOUNDS)
    return bounds


def measured_frfs(
    truth: Truth, q: np.ndarray, frequency_hz: np.ndarray, noise: float, seed: int = 0
) -> tuple[Frf, ...]:
    """FRFs at q (n, dof) with white noise.

    The noise of an accelerometer is the same at all lines and in all directions: `noise` is its
    share of the rms of the strongest of the three responses to a hit.
    """
    rng, out = np.random.default_rng(seed), []
    for row in q:
        h = truth.accelerance(row, frequency_hz)
        rms = np.sqrt(np.mean(np.abs(h) ** 2, axis=2)).max(axis=0)
        sd = np.broadcast_to(noise * rms[None, :, None], h.shape)
        error = sd * (rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape))
        band = float(frequency_hz[0]), float(frequency_hz[-1])
        nan = np.full(h.shape, np.nan)
        out.append(Frf(frequency_hz, h + error / np.sqrt(2), sd**2, nan, (1, 1, 1), band))
    return tuple(out)
