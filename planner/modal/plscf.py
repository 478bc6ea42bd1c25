"""Poly-reference least-squares complex frequency-domain estimator (pLSCF).

Right matrix fraction H(ω) = B(ω) A(ω)⁻¹ in the z-domain basis e^{iωΔt·r}, all hit directions at
once (Guillaume et al., ISMA 2003; Peeters et al., Shock and Vibration 11, 2004). With one
reference it is the common-denominator LSCF. A₀ = I is fixed: noise poles then come out unstable
and drop out (Cauberghe, PhD thesis, VUB 2004, ch. 3).

Poles that stay put over model orders are the lines of the stabilisation diagram.
"""

from dataclasses import dataclass

import numpy as np

from planner.modal.least_squares import proportional

# Relative ridge on the normal matrices: a band that leaves part of the circle empty makes them
# singular to rounding, and only to rounding.
RIDGE = 1e-12


@dataclass(frozen=True, eq=False)
class PoleSet:
    """Poles with positive frequency and damping that one model order gives."""

    order: int
    poles: np.ndarray  # (k,) rad/s
    participation: np.ndarray  # (k, inputs), unit length


def ladder(most: int, lines: int) -> tuple[int, ...]:
    """Model orders of the diagram: all at first, then every second, then every fourth.

    High orders cost most (their cube) and differ least from their neighbours.
    """
    # At least as many lines as half the unknowns of one column need, and once that to spare.
    top = max(2, min(most, lines // 3))
    steps = ((2, 20, 1), (20, 40, 2), (40, top, 4))
    orders = {n for low, high, step in steps for n in range(low, min(high, top) + 1, step)}
    return tuple(sorted(orders | {top}))


def plscf(
    frequency_hz: np.ndarray, frf: np.ndarray, most: int, weight: np.ndarray | None = None,
    reach_hz: tuple[float, float] | None = None,
) -> "Diagram":  # fmt: skip
    """Poles of model orders up to `most`, followed in `reach_hz` (the lines and 5 % beyond).

    frequency_hz (F,) increasing, > 0; frf (outputs, inputs, F) complex, finite, of any kind
    (receptance, mobility, accelerance: the poles are the same and the numerator takes the
    rest); weight (outputs, F), ≥ 0, multiplies the squared equation error of one output's row,
    usually 1/variance. An order n gives n·inputs poles, of which those with positive frequency
    and damping are returned.
    """
    base, step, z = _circle(2 * np.pi * np.asarray(frequency_hz))
    scale, scaled = _scaled(frf)
    orders, found = ladder(most, len(z)), []
    normal, coupling = _normal(z, scaled, weight, orders[-1])
    for order in orders:
        coefficients = _denominator(order, normal, coupling)
        # 1/z for det Σ A_r z^r = 0 with A₀ = I: eigenvalues of the block companion matrix
        inputs = coefficients.shape[1]
        companion = np.eye(order * inputs, k=-inputs)
        companion[:inputs] = -coefficients[1:].transpose(1, 0, 2).reshape(inputs, -1)
        roots = np.linalg.eigvals(companion)
        roots = 1 / roots[np.abs(roots) > 1e-12]
        inside = (np.abs(roots) < 1) & (np.abs(roots) > 1e-6) & (roots.imag > 0)
        roots = roots[inside].astype(complex)
        participation = _participation(coefficients, roots) * scale
        participation /= np.linalg.norm(participation, axis=1, keepdims=True)
        poles = np.log(roots) / step + 1j * base
        by_frequency = np.argsort(poles.imag)
        found.append(PoleSet(order, poles[by_frequency], participation[by_frequency]))
    return diagram(tuple(found), reach_hz or (0.95 * frequency_hz[0], 1.05 * frequency_hz[-1]))


def row_errors(
    frequency_hz: np.ndarray, frf: np.ndarray, order: int, weight: np.ndarray | None = None
) -> np.ndarray:
    """(outputs,) how badly each row fits the denominator of all, relative to the row: 0 is well.

    One weight per row, the same for all lines. A row with a turned sign or with exchanged columns
    has other poles than the rest and stands out.
    """
    *_, z = _circle(2 * np.pi * np.asarray(frequency_hz))
    scaled = _scaled(frf)[1]
    normal, coupling = _normal(z, scaled, weight, order)
    inputs = frf.shape[1]
    coefficients = _denominator(order, normal, coupling)
    powers = z ** np.arange(order + 1)[:, None]
    denominator = np.einsum("rij,rf->ijf", coefficients, powers)
    seen = np.einsum("oif,ijf->ojf", scaled, denominator)
    basis = np.concatenate([powers.real, powers.imag], axis=1)
    values = np.concatenate([seen.real, seen.imag], axis=-1).reshape(-1, 2 * z.size)
    orthonormal = np.linalg.qr(basis.T)[0]
    left = np.sum(values**2, axis=1) - np.sum((values @ orthonormal) ** 2, axis=1)
    power = np.sum(values**2, axis=1).reshape(-1, inputs).sum(axis=1)
    return left.reshape(-1, inputs).sum(axis=1) / np.maximum(power, 1e-300)


def _scaled(frf: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Root mean square (inputs,) of each column, and the columns divided by it."""
    scale = np.sqrt(np.mean(np.abs(frf) ** 2, axis=(0, 2)))
    scale = np.where(scale > 0, scale, 1.0)
    return scale, frf / scale[:, None]


def _circle(omega: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Base (rad/s) and step (s) of angle = (ω − base)·step, and where lines are on the circle.

    The band lies on the upper half of the unit circle.
    """
    low, high = omega[0], omega[-1]
    # A band far above zero is moved down, or most of the circle would hold no data.
    base = low if low > 0.5 * high else 0.0
    step = np.pi / (high - base)
    return base, step, np.exp(1j * (omega - base) * step)


def _normal(
    z: np.ndarray, frf: np.ndarray, weight: np.ndarray | None, order: int
) -> tuple[np.ndarray, np.ndarray]:
    """Denominator block of the normal equations and its coupling to the numerators.

    Returns T (n+1, i, n+1, i), the sum over outputs, and V = L⁻¹S (outputs, n+1, n+1, i) with
    R = LLᵀ: the reduced matrix of any order m is T − Σ VᵀV over the leading m + 1 blocks.
    Everything is (block) Toeplitz because the basis is a power of z, so sums per lag suffice.
    """
    outputs, inputs, lines = frf.shape
    w = np.ones((outputs, lines)) if weight is None else weight / np.mean(weight)
    if proportional(w):  # one numerator's matrix for all outputs
        frf, w = frf * np.sqrt(w[:, :1, None] / w[0, 0]), w[:1]
    lags = z[None, :] ** np.arange(order + 1)[:, None]
    index = np.arange(order + 1)
    lag = index[None, :] - index[:, None]  # column power minus row power
    total = np.zeros((order + 1, inputs, order + 1, inputs))
    reduced = np.empty((outputs, order + 1, order + 1, inputs))
    for own, profile in zip(np.array_split(np.arange(outputs), len(w)), w, strict=True):
        h = frf[own]
        s = _two_sided(lags, (profile * h).reshape(-1, lines).T).real  # for lags −n…n
        products = np.einsum("oif,ojf->ijf", h.conj(), profile * h).reshape(-1, lines)
        t = _two_sided(lags, products.T).real.reshape(-1, inputs, inputs)
        # R = LLᵀ, the Toeplitz matrix of sums by lag, with its ridge
        r = (lags @ profile).real
        gram = r[np.abs(lag)]
        gram[index, index] *= 1 + RIDGE * (order + 1)
        factor = np.linalg.cholesky(gram + RIDGE * r[0] * np.eye(order + 1))
        coupled = -s[lag + order].reshape(order + 1, -1)
        found = np.linalg.solve(factor, coupled).reshape(order + 1, order + 1, -1, inputs)
        reduced[own] = found.transpose(2, 0, 1, 3)
        total += t[lag + order].transpose(0, 2, 1, 3)
    return total, reduced


def _two_sided(lags: np.ndarray, data: np.ndarray) -> np.ndarray:
    """Σ_f z^l data_f for l = −n…n."""
    return np.concatenate([(lags[:0:-1].conj()) @ data, lags @ data])


def _denominator(order: int, normal: np.ndarray, coupling: np.ndarray) -> np.ndarray:
    """(order + 1, inputs, inputs) coefficients A_r, A₀ = I."""
    inputs = normal.shape[1]
    size = (order + 1) * inputs
    block = normal[: order + 1, :, : order + 1].reshape(size, size)
    v = coupling[:, : order + 1, : order + 1].reshape(-1, size)
    block = block - v.T @ v
    ridge = RIDGE * np.trace(block) / size
    inner = block[inputs:, inputs:] + ridge * np.eye(size - inputs)
    a = -np.linalg.solve(inner, block[inputs:, :inputs])
    return np.concatenate([np.eye(inputs)[None], a.reshape(order, inputs, inputs)])


def _participation(coefficients: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Left null vectors u of A(z): the residue is ψuᵀ, so u weighs the hit directions."""
    if coefficients.shape[1] == 1 or z.size == 0:
        return np.ones((z.size, coefficients.shape[1]), complex)
    powers = z[:, None] ** np.arange(coefficients.shape[0])
    values = np.einsum("kr,rij->kij", powers, coefficients)
    left = np.linalg.svd(values)[0]
    return left[:, :, -1].conj()


# One order to the next a physical pole moves less than this (share of its frequency, of its own
# bandwidth, and 1 − MAC of its participation).
FREQUENCY_STEP, BANDWIDTH_STEP, MAC_STEP = 0.01, 1.0, 0.3


@dataclass(frozen=True, eq=False)
class Line:
    """One vertical line of the diagram: the same pole in several orders."""

    orders: np.ndarray  # (k,) increasing
    poles: np.ndarray  # (k,)
    participation: np.ndarray  # (k, inputs)
    share: float  # orders present / orders tried since it first appeared

    @property
    def reach(self) -> int:
        """Over how many orders it goes."""
        return int(self.orders[-1] - self.orders[0])

    @property
    def late(self) -> np.ndarray:
        """Those of the upper half of the orders, where bias has died out."""
        return self.poles[len(self.poles) // 2 :]

    @property
    def pole(self) -> complex:
        """The median of the late ones."""
        return complex(np.median(self.late.real), np.median(self.late.imag))

    @property
    def frequency_hz(self) -> float:
        return float(np.abs(self.pole) / (2 * np.pi))

    @property
    def damping_ratio(self) -> float:
        return float(-self.pole.real / np.abs(self.pole))

    @property
    def scatter(self) -> float:
        """Spread of the late poles, relative to the bandwidth."""
        return float(np.sqrt(np.mean(np.abs(self.late - self.pole) ** 2)) / abs(self.pole.real))


@dataclass(frozen=True, eq=False)
class Diagram:
    """Poles of all orders and the lines that they form, increasing in frequency."""

    sets: tuple[PoleSet, ...]
    lines: tuple[Line, ...]

    @property
    def order(self) -> int:
        """The highest."""
        return self.sets[-1].order

    @property
    def start(self) -> np.ndarray:
        """(m,) in rad/s: the poles of stable lines."""
        return np.array([line.pole for line in stable(self)], complex)

    def support(self, pole: complex) -> float:
        """Share of the upper half of the orders with a pole within half a bandwidth or 0.5 %."""
        upper = self.sets[len(self.sets) // 2 :]
        reach = max(abs(pole.real), 0.005 * abs(pole))
        near = [np.any(np.abs(entry.poles.imag - pole.imag) < reach) for entry in upper]
        return float(np.mean(near))


def diagram(sets: tuple[PoleSet, ...], band_hz: tuple[float, float]) -> Diagram:
    """Join the poles of increasing orders to lines.

    An order gives at most one pole to a line and each pole to at most one line (nearest pairs
    first), so close modes stay apart. Poles outside `band_hz` or damped more than 30 % are not
    followed.
    """
    growing: list[list[tuple[int, complex, np.ndarray]]] = []
    for index, entry in enumerate(sets):
        size = np.abs(entry.poles)
        frequency = size / (2 * np.pi)
        keep = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
        keep &= -entry.poles.real < 0.3 * size
        poles, participation = entry.poles[keep], entry.participation[keep]
        # Orders that a pole may be missing before its line counts as ended.
        open_lines = [g for g in growing if index - g[-1][0] <= 3]
        pairs = _pair(open_lines, poles, participation)
        taken = {pole for _, pole in pairs}
        for line, pole in pairs:
            open_lines[line].append((index, poles[pole], participation[pole]))
        growing += [
            [(index, poles[k], participation[k])] for k in range(len(poles)) if k not in taken
        ]
    lines = []
    for members in growing:
        index, poles, participation = map(np.array, zip(*members, strict=True))
        orders = np.array([sets[i].order for i in index])
        share = len(members) / (len(sets) - int(index[0]))
        lines.append(Line(orders, poles, participation, share))
    return Diagram(sets, tuple(sorted(lines, key=lambda line: line.frequency_hz)))


def stable(found: Diagram, least: int = 5, share: float = 0.4) -> tuple[Line, ...]:
    """Lines seen in at least `least` orders and in `share` of those since they first appeared."""
    need = min(least, max(2, len(found.sets) // 3))
    return tuple(x for x in found.lines if len(x.orders) >= need and x.share >= share)


def _pair(lines: list, poles: np.ndarray, participation: np.ndarray) -> list[tuple[int, int]]:
    if not lines or not len(poles):
        return []
    last = np.array([line[-1][1] for line in lines])
    vectors = np.array([line[-1][2] for line in lines])
    distance = np.abs(last[:, None] - poles)
    width = np.maximum(np.abs(last.real)[:, None], np.abs(poles.real))
    mac = np.abs(vectors.conj() @ participation.T) ** 2
    limit = np.maximum(FREQUENCY_STEP * np.abs(last)[:, None], BANDWIDTH_STEP * width)
    close = np.abs(last.imag[:, None] - poles.imag) < FREQUENCY_STEP * np.abs(last)[:, None]
    close |= np.abs(last.imag[:, None] - poles.imag) < 0.3 * width
    ok = close & (distance < limit) & (1 - mac < MAC_STEP)
    cost = np.where(ok, distance / width + (1 - mac), np.inf)
    pairs = []
    while cost.size and np.isfinite(np.min(cost)):
        i, k = np.unravel_index(np.argmin(cost), cost.shape)
        pairs.append((int(i), int(k)))
        cost[i] = np.inf
        cost[:, k] = np.inf
    return pairs
