"""FRFs as few poles and residues, whatever made them: by relaxed vector fitting.

All entries share the poles, which move in every round to the zeros of a common denominator
(Gustavsen and Semlyen, IEEE Trans. Power Delivery 14, 1999; relaxed: Gustavsen, 21, 2006). Poles
that would grow are reflected. Every line counts alike, by its error relative to the matrix there,
so that weak modes are met as well as strong ones.
"""

from dataclasses import dataclass

import numpy as np

# Relative error of a fit that needs no more poles. At 1e-3 limits of a simulated milling robot were
# still off by 8 %, through harmonics of the tooth passing near the end of the band.
CLOSE = 1e-5


@dataclass(frozen=True, eq=False)
class RationalFit:
    """H(s) = Σ R/(s − λ) + R*/(s − λ*) + rest, poles (k,), R (k, o, i), rest (o, i) real.

    `error` is the rms over lines of ‖H − fit‖/‖H‖.
    """

    poles: np.ndarray
    residues: np.ndarray
    rest: np.ndarray
    error: float

    def response(self, frequency_hz: np.ndarray) -> np.ndarray:
        """(o, i, F) of the kind that was fitted."""
        s = 2j * np.pi * np.asarray(frequency_hz)
        found = np.einsum("koi,kf->oif", self.residues, 1 / (s - self.poles[:, None]))
        found += np.einsum(
            "koi,kf->oif", self.residues.conj(), 1 / (s - self.poles.conj()[:, None])
        )
        return found + self.rest[..., None]


def rational_fit(
    frequency_hz: np.ndarray,
    response: np.ndarray,
    start: np.ndarray | None = None,
    close: float = CLOSE,
) -> RationalFit:
    """Of a receptance (o, i, F) at lines (F,) above 0 Hz, with as many poles as it needs.

    With poles `start` (k,) in rad/s, as many as these, from there on. An error of `close` needs no
    more poles.
    """
    if start is not None:
        return _settled(frequency_hz, response, start)
    best: RationalFit | None = None
    idle = 0
    # Most pairs.
    for pairs in range(1, min(14, len(frequency_hz) // 4) + 1):
        hertz = np.geomspace(frequency_hz[0], frequency_hz[-1], pairs + 2)[1:-1]
        # First damping of the poles that a fit begins with
        first = 2 * np.pi * hertz * (-0.01 + 1j)
        found = _settled(frequency_hz, response, first)
        # Gained: share of the error left: more poles that leave more of it are not worth it
        if best is None or found.error < 0.85 * best.error:
            best, idle = found, 0
        else:
            idle += 1
        # Patience: numbers of poles in a row that gain nothing before more of them are not tried
        if best.error < close or idle == 3:
            break
    assert best is not None
    return best


def _settled(hertz: np.ndarray, response: np.ndarray, poles: np.ndarray) -> RationalFit:
    shape = response.shape
    h = response.reshape(-1, shape[-1])
    size = np.linalg.norm(h, axis=0)
    weight = 1 / np.maximum(size, 1e-9 * size.max())
    scale = 2 * np.pi * hertz[-1]
    s, p = 2j * np.pi * hertz / scale, np.sort_complex(poles / scale)
    # Rounds of moving the poles, for each number of them
    for _ in range(12):
        moved = np.sort_complex(_relocated(s, h, weight, p))
        # Settled: relative change of the poles in a round that is the last
        still = len(moved) == len(p) and np.max(np.abs(moved - p) / np.abs(p)) < 1e-9
        p = moved
        if still:
            break
    basis = _basis(s, p)
    columns = np.concatenate([basis, np.ones((1, len(s)))]) * weight
    real = np.concatenate([columns.real, columns.imag], axis=1).T
    wanted = np.concatenate([(h * weight).real, (h * weight).imag], axis=1).T
    unit = np.linalg.norm(real, axis=0)
    c = np.linalg.lstsq(real / unit, wanted, rcond=1e-12)[0] / unit[:, None]
    k = len(p)
    residues = ((c[:k] + 1j * c[k : 2 * k]) * scale).reshape(k, *shape[:-1])
    off = (real @ c - wanted).reshape(2, len(s), -1)
    error = float(np.sqrt(np.mean(np.sum(off**2, axis=(0, 2)))))
    return RationalFit(p * scale, residues, c[-1].reshape(shape[:-1]), error)


def _basis(s: np.ndarray, poles: np.ndarray) -> np.ndarray:
    """(2k, F): responses to the real and to the imaginary part of each residue."""
    direct, conjugate = 1 / (s - poles[:, None]), 1 / (s - poles.conj()[:, None])
    return np.concatenate([direct + conjugate, 1j * (direct - conjugate)])


def _relocated(s: np.ndarray, h: np.ndarray, weight: np.ndarray, poles: np.ndarray) -> np.ndarray:
    """Zeros of the common denominator, those above the real axis; real ones become a pair."""
    basis = _basis(s, poles)
    k2 = len(basis)
    own = np.concatenate([basis, np.ones((1, len(s)))])
    blocks = []
    for row in h:
        full = np.concatenate([own, -own * row]) * weight
        stacked = np.concatenate([full.real, full.imag], axis=1).T
        triangle = np.asarray(np.linalg.qr(stacked, mode="r"))
        blocks.append(triangle[k2 + 1 :, k2 + 1 :])
    # The denominator's mean real part is held at one: nothing else fixes its size.
    blocks.append(np.sum(own.real, axis=1)[None] / len(s))
    a = np.concatenate(blocks)
    target = np.zeros(len(a))
    target[-1] = 1.0
    unit = np.linalg.norm(a, axis=0)
    c = np.linalg.lstsq(a / unit, target, rcond=1e-12)[0] / unit
    k = len(poles)
    free = np.block([
        [np.diag(poles.real), np.diag(poles.imag)], [-np.diag(poles.imag), np.diag(poles.real)],
    ])  # fmt: skip
    into = np.concatenate([np.full(k, 2.0), np.zeros(k)])
    zeros = np.linalg.eigvals(free - np.outer(into, c[:k2]) / c[-1])
    zeros = np.where(zeros.real > 0, -zeros.conj(), zeros)
    upper = zeros[zeros.imag > 1e-9 * np.abs(zeros)]
    real = np.sort(zeros[np.abs(zeros.imag) <= 1e-9 * np.abs(zeros)].real)
    # Two real poles are put together as an oscillation just under critical damping.
    joined = -np.sqrt(np.abs(real[0 : 2 * (len(real) // 2) : 2] * real[1::2])) * (1 - 0.05j)
    return np.concatenate([upper, joined])
