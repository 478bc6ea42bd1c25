"""Experimental modes of one pose."""

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from planner.frf.synthesis import pole
from planner.recording.points import Dof
from planner.recording.uff import Geometry

# Less likely poles are not reported as modes.
LEAST_PROBABILITY = 0.2


@dataclass(frozen=True, eq=False)
class Eigenvectors:
    """Of a mode without reciprocity, R = right · leftᵀ / (2iω_d) (Lei et al. 2023, eq. 15).

    `right` (responses,) is how points move, `left` (references,) how hits there drive it, each with
    the sd of real and imaginary part. Of reciprocal structures both are the mode's shape.
    """

    right: np.ndarray
    right_sd: np.ndarray
    left: np.ndarray
    left_sd: np.ndarray


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode: pole, residues, shape, and their standard deviations.

    Pole λ = −ζω₀ + iω₀√(1−ζ²), ω₀ = 2π·frequency_hz. Receptance
    H(ω) = Σ R/(iω−λ) + R*/(iω−λ*), accelerance −ω² times that, so `residue` (outputs, inputs) is
    in m/(N·s); columns never hit are NaN, as are all where nothing scales them. `shape` (n,) is of
    unit modal mass (kg^-1/2) where `scaled`, else of unit length and as real as possible;
    `shape_sd` (n,), like `residue_sd`, is of real and imaginary part each. `collinearity` is the
    MPC, `deviation_deg` the MPD. `scatter_hz` is the sd of the frequency from set to set of roving
    points beyond their noise. `vectors` are of a matrix of FRFs. What an analysis does not tell is
    NaN or None.
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
    scatter_hz: float = 0.0
    vectors: Eigenvectors | None = None

    @property
    def pole(self) -> complex:
        """Pole λ in rad/s."""
        return complex(pole(self.frequency_hz, self.damping_ratio))

    @property
    def modal_mass_kg(self) -> float:
        """Of the shape with largest component 1; NaN where it has no scale."""
        return 1 / float(np.max(np.abs(self.shape)) ** 2) if self.scaled else float("nan")

    @property
    def driven(self) -> tuple[np.ndarray, np.ndarray]:
        """Left vector (references,) and its sd: what hits drive of a shape of unit length (1/kg).

        R = shape · leftᵀ / (2iω_d), least squares; of a matrix of FRFs as in `vectors`. NaN where
        nothing was hit.
        """
        if self.vectors is not None:
            return self.vectors.left, self.vectors.left_sd
        twice, size = 2 * self.pole.imag, float(np.linalg.norm(self.shape))
        if len(self.residue) != len(self.shape):
            return np.zeros(0, complex), np.zeros(0)
        left = 1j * twice * (self.shape.conj() @ self.residue) / size**2
        sd = twice * np.sqrt(np.abs(self.shape) ** 2 @ self.residue_sd**2) / size**2
        return left, sd

    @property
    def modal_stiffness_n_m(self) -> tuple[np.ndarray, np.ndarray]:
        """ω_n² m / φ² (n,) of each response that is hit where it is felt, and its sd.

        NaN where it was not hit, or where nothing scales the shape.
        """
        n = len(self.shape)
        if self.scaled:
            sd = np.zeros(n) if self.shape_sd is None else self.shape_sd
            size, sd = np.abs(self.shape) ** 2, 2 * np.abs(self.shape) * sd
        elif self.residue.shape == (n, n):
            own = np.diagonal(self.residue), np.diagonal(self.residue_sd)
            size, sd = (2 * self.pole.imag * np.abs(part) for part in own)
        else:
            return np.full(n, np.nan), np.full(n, np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):
            stiffness = (2 * np.pi * self.frequency_hz) ** 2 / size
            relative = np.hypot(2 * self.frequency_sd_hz / self.frequency_hz, sd / size)
            return stiffness, stiffness * relative


# Residues of a mode, and their sds, where nothing scales them.
UNSCALED = np.full((3, 3), np.nan + 0j), np.full((3, 3), np.nan)


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


class ForceLevel(msgspec.Struct, frozen=True):
    """Hits of about one strength, and the pose's modes by them alone (None: not found)."""

    peak_force_n: float  # mean of the hits' peaks
    hits: int
    frequency_hz: tuple[float | None, ...]
    frequency_sd_hz: tuple[float | None, ...]
    damping_ratio: tuple[float | None, ...]
    damping_sd: tuple[float | None, ...]


class Homogeneity(msgspec.Struct, frozen=True):
    """Whether the response is proportional to the force, over the levels of one pose.

    Weakest first. `difference` is the largest relative difference ‖ΔH‖/‖H‖ between the FRFs of two
    levels in the band beyond what their scatter explains; `p_value` the chance of so much scatter
    alone, 1 where hits were not repeated: no two miss alike. `homogeneous`: nothing worth telling
    depends on the level.
    """

    levels: tuple[ForceLevel, ...]
    difference: float
    p_value: float
    homogeneous: bool


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
