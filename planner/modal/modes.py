"""Experimental modes of one pose."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.recording.dof import Dof
from planner.recording.geometry import Geometry

# Less likely poles are not reported as modes.
LEAST_PROBABILITY = 0.2


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode: pole, residues, shape, and their standard deviations.

    Pole λ = −ζω₀ + iω₀√(1−ζ²), ω₀ = 2π·frequency_hz. Receptance
    H(ω) = Σ R/(iω−λ) + R*/(iω−λ*), accelerance −ω² times that, so `residue` (outputs, inputs) is
    in m/(N·s); columns never hit are NaN, as are all where nothing scales them. `shape` (n,) is of
    unit modal mass (kg^-1/2) where `scaled`, else of unit length and as real as possible;
    `shape_sd` (n,), like `residue_sd`, is of real and imaginary part each. `collinearity` is the
    MPC, `deviation_deg` the MPD. `misfit` is χ² per degree of freedom that one shape leaves in the
    residues, `scatter_hz` the sd of the frequency from set to set of roving points beyond their
    noise, `support` the share of the higher model orders that have this pole. What an analysis does
    not tell is NaN or None.
    """

    frequency_hz: float
    frequency_sd_hz: float
    damping_ratio: float
    damping_sd: float
    residue: np.ndarray  # complex
    residue_sd: np.ndarray
    shape: np.ndarray  # complex
    probability: float = 1.0  # that it is a physical mode
    shape_sd: np.ndarray | None = None
    scaled: bool = False
    collinearity: float = float("nan")
    deviation_deg: float = float("nan")
    misfit: float = float("nan")
    scatter_hz: float = 0.0
    support: float = float("nan")

    @property
    def pole(self) -> complex:
        """Pole λ in rad/s."""
        w = 2 * np.pi * self.frequency_hz
        return complex(-self.damping_ratio * w, w * np.sqrt(max(0.0, 1 - self.damping_ratio**2)))

    @property
    def modal_mass_kg(self) -> float:
        """Of the shape with largest component 1; NaN where it has no scale."""
        return 1 / float(np.max(np.abs(self.shape)) ** 2) if self.scaled else float("nan")

    def unscaled(self) -> "Mode":
        """The same without residues, which nothing scales."""
        nothing = np.full((3, 3), np.nan)
        return replace(self, residue=nothing.astype(complex), residue_sd=nothing)


@dataclass(frozen=True, eq=False)
class ModalModel:
    """All modes found at one pose, increasing in frequency, and how well they fit.

    `doubtful` are poles less likely than `LEAST_PROBABILITY` to be a mode by this pose alone;
    other poses may speak for them (a mode near a nodal point is weak).
    """

    modes: tuple[Mode, ...]
    band_hz: tuple[float, float]
    fit_error: float  # ‖H − fit‖/‖H‖ over measured columns and band
    order: int  # model order from which the poles were taken
    remarks: tuple[str, ...] = ()
    doubtful: tuple[Mode, ...] = ()


LARGEST = 0.12  # of the structure's size: how far the point moves that moves most
AXIS = {"x": 0, "y": 1, "z": 2}


def motions(dofs: Sequence[Dof], shape: np.ndarray, geometry: Geometry) -> np.ndarray:
    """(nodes, 3) complex motion of every node of the geometry, the largest of size 1.

    Points not measured stand still; a direction that is not known counts as z.
    """
    place = {node: k for k, node in enumerate(geometry.nodes)}
    motion = np.zeros((len(place), 3), complex)
    for dof, value in zip(dofs, shape, strict=True):
        if dof.node in place and not dof.is_turn:
            axis = AXIS.get(dof.positive.direction, 2)
            motion[place[dof.node], axis] += dof.sign * value
    # The instant of largest motion comes first.
    motion = motion * np.exp(-0.5j * np.angle(np.sum(motion**2)))
    largest = float(np.max(np.linalg.norm(np.abs(motion), axis=1), initial=0.0))
    return motion / largest if largest > 0 else motion


def moved(geometry: Geometry, motion: np.ndarray, phase: float) -> np.ndarray:
    """(nodes, 3) where points are at a phase (rad) of the vibration, exaggerated."""
    span = float(np.linalg.norm(np.ptp(geometry.position_m, axis=0))) or 1.0
    return geometry.position_m + LARGEST * span * np.real(motion * np.exp(1j * phase))
