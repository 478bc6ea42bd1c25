"""Receptance coupling: the tested tool taken off, another one put on, at one pose.

All motions and rotations at once, cross terms included (Schmitz and Donaldson, CIRP Annals 49,
2000; Özşahin and Altintas, Int. J. Mach. Tools Manuf. 92, 2015; Lei et al. 2023, eqs. 1–4). A tool
maps the state (motion, force) of its tip to that of its holder. With the state of the tested
tool's tip, (C f, f), that of the target's tip is M (C f, f), where M = T₂⁻¹ T₁, and so

    C₂ = (M_uu C + M_uf) (M_fu C + M_ff)⁻¹,

which is eq. 4 of Lei et al. without its differences of large free-free receptances. An error δ in
C becomes (M_uu − C₂ M_fu) δ (M_fu C + M_ff)⁻¹: this says line by line how noise is amplified.

Stiffness and damping of a contact are identified as the literature does by hand (Lei et al. 2023,
section 5.3): the coupled FRFs are brought to the measured ones by the four numbers of the target's
contact. Those of the reference's own stay as stated, for only the difference of the two acts.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import find_peaks

from planner.errors import InputError
from planner.milling.tool import NUMBERS, Tool, ToolContact
from planner.recording.records import AXES

MOTIONS = ("x", "y", "z", "rx", "ry", "rz")
# Above this a 1 % error of every measured FRF is more than a tenth of the coupled one.
AMPLIFICATION_LIMIT = 10.0


@dataclass(frozen=True, eq=False)
class TipReceptance:
    """Receptances at the tip of the tested tool, and how they came from what was measured.

    C = left · measured · right + offset, in m/N, m/(N·m), rad/N and rad/(N·m), over the motions
    `kept` (numbers in MOTIONS, rotations about x, y, z) along the columns of `frame` (3, 3), which
    are given in the axes of the FRFs. `sd` is that of each measured value, and of C's own rest
    `offset_sd`, each taken for itself; where values err together, `errors` (D, F, n, n) says how,
    independent of each other and of one sd each, instead of `sd`.
    """

    frequency_hz: np.ndarray  # (F,) > 0
    kept: tuple[int, ...]  # k of the six
    measured: np.ndarray  # (F, n, n) complex
    sd: np.ndarray  # (F, n, n)
    left: np.ndarray  # (F, k, n)
    right: np.ndarray  # (F, n, k)
    offset: np.ndarray  # (F, k, k)
    offset_sd: np.ndarray  # (F, k, k)
    frame: np.ndarray = field(default_factory=lambda: np.eye(3))
    remarks: tuple[str, ...] = ()
    errors: np.ndarray | None = None
    simulated: bool = False  # the source says that it holds simulated, not measured, data

    @property
    def receptance(self) -> np.ndarray:
        """C (F, k, k)."""
        return self.left @ self.measured @ self.right + self.offset

    @classmethod
    def known(
        cls,
        frequency_hz: np.ndarray,
        receptance: np.ndarray,
        sd: np.ndarray | None = None,
        kept: tuple[int, ...] = tuple(range(6)),
    ) -> "TipReceptance":
        """From all receptances (k, k, F) of the motions `kept`, in the FRFs' axes, and their sd."""
        c = np.moveaxis(np.asarray(receptance, complex), -1, 0)
        spread = np.zeros(c.shape) if sd is None else np.moveaxis(np.asarray(sd, float), -1, 0)
        eye = np.broadcast_to(np.eye(len(kept), dtype=complex), c.shape)
        nothing = np.zeros(c.shape)
        return cls(np.asarray(frequency_hz, float), kept, c, spread, eye, eye, nothing, nothing)


@dataclass(frozen=True, eq=False)
class CoupledFrf:
    """Receptances (6, 6, F) at the tip of the target tool, their sd, and how noise grew.

    In the axes of the FRFs. The motions not `kept` were not measured: they are taken as held, and
    theirs are NaN. `amplification` (F,) is the relative error of the 3 × 3 of motions per force,
    in the Frobenius norm, for relative errors of one unit in every measured value, each by itself.
    """

    frequency_hz: np.ndarray
    kept: tuple[int, ...]
    receptance: np.ndarray
    sd: np.ndarray
    amplification: np.ndarray
    remarks: tuple[str, ...] = ()
    simulated: bool = False

    @property
    def accelerance(self) -> np.ndarray:
        """(6, 6, F) in m/s²/N and the like."""
        return self.receptance * (2j * np.pi * self.frequency_hz) ** 2

    @property
    def accelerance_sd(self) -> np.ndarray:
        """(6, 6, F): root of E|δH|²."""
        return self.sd * (2 * np.pi * self.frequency_hz) ** 2


def couple(tip: TipReceptance, target: Tool | None, reference: Tool | None = None) -> CoupledFrf:
    """The tip of the target tool, from receptances at the tip of the reference tool.

    Without a reference they are those of the holder itself; without a target the reference is only
    taken off. Uncertainty is linearised: measured values, and each number of each contact that
    states `sd_percent`.
    """
    coupled, left, right = _coupled(tip, target, reference)
    variance = _measured(left @ tip.left, tip, tip.right @ right)
    variance += _carried(left, tip.offset_sd**2, right)
    others = [(tool, reference) for tool in target.sd_away] if target else []
    others += [(target, tool) for tool in reference.sd_away] if reference else []
    for other in others:
        variance += np.abs(_coupled(tip, *other)[0] - coupled) ** 2
    own = tuple(k for k, motion in enumerate(tip.kept) if motion < 3)
    noise = _carried(left @ tip.left, np.abs(tip.measured) ** 2, tip.right @ right)
    size = np.sum(np.abs(coupled[np.ix_(range(len(coupled)), own, own)]) ** 2, axis=(1, 2))
    grown = np.sum(noise[np.ix_(range(len(coupled)), own, own)], axis=(1, 2))
    return CoupledFrf(
        tip.frequency_hz,
        tip.kept,
        _whole(coupled, tip.kept, tip.frame),
        np.sqrt(_whole(variance, tip.kept, tip.frame**2)),
        np.sqrt(grown / np.maximum(size, 1e-300)),
        tip.remarks,
        tip.simulated,
    )


def _coupled(
    tip: TipReceptance, target: Tool | None, reference: Tool | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """C₂ (F, k, k), and what stands to the left and right of an error of C in an error of C₂."""
    omega = 2 * np.pi * tip.frequency_hz
    m = np.broadcast_to(np.eye(12, dtype=complex), (len(omega), 12, 12))
    if reference is not None:
        m = turned(reference.transfer(omega), tip.frame.T @ reference.frame)
    if target is not None:
        m = inverse(turned(target.transfer(omega), tip.frame.T @ target.frame)) @ m
    u = np.array(tip.kept)
    pairs = ((u, u), (u, u + 6), (u + 6, u), (u + 6, u + 6))
    uu, uf, fu, ff = (m[np.ix_(np.arange(len(omega)), a, b)] for a, b in pairs)
    c = tip.receptance
    right = np.linalg.inv(fu @ c + ff)
    coupled = (uu @ c + uf) @ right
    return coupled, uu - coupled @ fu, right


def turned(transfer: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """A tool's transfer (F, 12, 12) in the axes in which the columns of `frame` are its own."""
    turn = np.kron(np.eye(4), frame)
    return turn @ transfer @ turn.T


def inverse(transfer: np.ndarray) -> np.ndarray:
    """Of (F, 12, 12): reciprocity makes it symplectic, so that nothing has to be solved."""
    uu, uf = transfer[:, :6, :6], transfer[:, :6, 6:]
    fu, ff = transfer[:, 6:, :6], transfer[:, 6:, 6:]
    uu, uf, fu, ff = (np.swapaxes(block, 1, 2) for block in (uu, uf, fu, ff))
    return np.block([[ff, -uf], [-fu, uu]])


def _carried(left: np.ndarray, variance: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Variance of left · δ · right, of independent entries δ."""
    return np.abs(left) ** 2 @ variance @ np.abs(right) ** 2


def _measured(left: np.ndarray, tip: TipReceptance, right: np.ndarray) -> np.ndarray:
    """Variance of left · δ · right of the measured values' errors δ."""
    if tip.errors is None:
        return _carried(left, tip.sd**2, right)
    return np.sum([np.abs(left @ error @ right) ** 2 for error in tip.errors], axis=0)


def _whole(values: np.ndarray, kept: tuple[int, ...], frame: np.ndarray) -> np.ndarray:
    """(F, k, k) as (6, 6, F) in the axes in which `frame` is given, NaN where nothing is known."""
    out = np.zeros((len(values), 6, 6), values.dtype)
    out[np.ix_(range(len(values)), kept, kept)] = values
    turn = np.kron(np.eye(2), frame)
    whole = np.moveaxis(turn @ out @ turn.T, 0, -1)
    # A direction is not known where motions that were not kept have a share in it.
    lacking = [k for k in range(6) if k not in kept]
    # Share of an axis in another: rounding
    unknown = np.any(np.abs(turn[:, lacking]) > 1e-9, axis=1)
    whole[unknown] = np.nan
    whole[:, unknown] = np.nan
    return whole


@dataclass(frozen=True)
class Resonance:
    """A peak of a direct FRF: size in m/N, its relative sd, how errors grew there."""

    direction: str
    frequency_hz: float
    receptance_m_n: float
    sd_percent: float
    amplification: float


@dataclass(frozen=True)
class VerifyingHit:
    """A hit at the target's tip where the coupled FRF is least sure, and what to expect of it.

    `expected_m_n` and `sd_m_n` are receptance and sd at `frequency_hz`, read along the hit.
    """

    hit: str
    frequency_hz: float
    expected_m_n: float
    sd_m_n: float

    @property
    def sentence(self) -> str:
        """What to do."""
        told = f"{1e6 * self.expected_m_n:.3g}"
        at = f"µm/N at {self.frequency_hz:.4g} Hz"
        if self.sd_m_n > 0:
            told, at = f"{told} ± {1e6 * self.sd_m_n:.2g}", f"{at}, where it is least sure"
        return (
            f"To verify: hit the target's tip along {self.hit} and read {self.hit[1]} there; "
            f"expect {told} {at}."
        )


def resonances(coupled: CoupledFrf) -> tuple[Resonance, ...]:
    """Peaks of the direct FRFs, direction by direction, by frequency."""
    size = _direct(coupled)
    # Peaks below this share of the largest of the three directions are not listed.
    least = 0.02 * size.max()
    return tuple(
        _at(coupled, k, line) for k in range(3) for line in find_peaks(size[k], least)[0]
    )  # fmt: skip


def _direct(coupled: CoupledFrf) -> np.ndarray:
    """(3, F) sizes of the direct FRFs, 0 where nothing is known."""
    return np.nan_to_num(np.abs(coupled.receptance[range(3), range(3)]))


def _at(coupled: CoupledFrf, axis: int, line: int) -> Resonance:
    size = np.abs(coupled.receptance[axis, axis, line])
    return Resonance(
        AXES[axis], float(coupled.frequency_hz[line]), float(size),
        float(100 * coupled.sd[axis, axis, line] / size), float(coupled.amplification[line]),
    )  # fmt: skip


def verifying_hit(coupled: CoupledFrf) -> VerifyingHit:
    """The direction and resonance at whose peak the receptance is least sure.

    By its absolute sd, for a resonance matters to the cut by its size; without any sd the largest.
    """
    direct = _direct(coupled)
    largest = np.unravel_index(np.argmax(direct), direct.shape)
    each = [
        (peak.receptance_m_n * peak.sd_percent / 100, peak.receptance_m_n, peak)
        for peak in resonances(coupled) or (_at(coupled, *map(int, largest)),)
    ]
    sd, size, best = max(each, key=lambda one: one[:2])
    return VerifyingHit(f"+{best.direction}", best.frequency_hz, size, sd)


FARTHEST = np.log(1e3)  # from the numbers stated: the prior's bounds
PRIOR_SD = np.log(10.0)  # of each number around its stated one
STARTS = (0.0, -1.5)  # of stiffnesses, as logarithms beside those stated
KNOWN = np.log(3.0)  # sd of a logarithm from which a number counts as not determined


@dataclass(frozen=True, eq=False)
class ContactFit:
    """The target with its contact, and sds of the logarithms of the four numbers (4,).

    `before` and `after` are the relative misfits as stated and now.
    """

    tool: Tool
    contact: ToolContact
    log_sd: np.ndarray
    before: float
    after: float

    def to_json(self) -> dict[str, object]:
        """Numbers with their sd in percent (None: not determined), misfits in percent."""
        numbers = {
            name: {
                "value": getattr(self.contact, name),
                "sd_percent": None if sd > KNOWN else 100 * float(sd),
            }
            for name, sd in zip(NUMBERS, self.log_sd, strict=True)
        }
        return {
            **numbers,
            "misfit_before_percent": 100 * self.before,
            "misfit_percent": 100 * self.after,
        }


def fit_contact(
    tip: TipReceptance, target: Tool, reference: Tool | None, seen: np.ndarray
) -> ContactFit:
    """From receptances (3, 3, F) measured at the target's tip, NaN where they were not.

    At the lines of `tip`. Raises InputError where the target states no contact to begin with.
    """
    contacts = target.contacts()
    if not contacts:
        raise InputError(
            f"{target.name} has no [segment.contact] to be identified; state one to begin with."
        )
    number, stated = contacts[0]
    first = couple(tip, target, reference)
    known = np.isfinite(seen) & np.isfinite(first.receptance[:3, :3])
    if not np.any(known):
        raise InputError(f"No measured FRF of {target.name} is along a direction of the source.")
    begin = np.log([max(getattr(stated, name), 1e-9) for name in NUMBERS])

    def held(z: np.ndarray) -> Tool:
        values = np.exp(begin + z)
        return target.held(number, ToolContact(*(float(v) for v in values)))

    size = np.abs(np.where(known, seen, 1.0))
    # Relative error that the model is allowed where measured FRFs and coupled ones state less:
    # tools are no rods.
    sd = np.hypot(0.02 * size, np.where(known, first.sd[:3, :3], 0.0))[known]

    def off(z: np.ndarray) -> np.ndarray:
        away = (couple(tip, held(z), reference).receptance[:3, :3] - seen)[known] / sd
        return np.concatenate([away.real, away.imag, z / PRIOR_SD])

    tries = (
        least_squares(off, [start, start, 0.0, 0.0], bounds=(-FARTHEST, FARTHEST), max_nfev=60)
        for start in STARTS
    )
    found = min(tries, key=lambda one: one.cost)
    spread = max(2 * found.cost / max(2 * np.count_nonzero(known) - 4, 1), 1.0)
    covariance = np.linalg.inv(found.jac.T @ found.jac) * spread

    def misfit(tool: Tool) -> float:
        error = (couple(tip, tool, reference).receptance[:3, :3] - seen)[known]
        return float(np.linalg.norm(error) / np.linalg.norm(seen[known]))

    best = held(found.x)
    contact = best.contacts()[0][1]
    log_sd = np.sqrt(np.diagonal(covariance))
    return ContactFit(best, contact, log_sd, misfit(target), misfit(best))
