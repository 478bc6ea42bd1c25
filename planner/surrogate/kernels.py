"""Kernels, and sums and products of them (Rasmussen & Williams 2006, chapter 4).

A shape is a pure function with unit variance: it takes the array library (numpy or jax.numpy),
xa (…, a, d), xb (…, b, d) already divided by the length scales, and returns (…, a, b). A `Kernel`
is an expression such as "matern52", "rbf+bias" or "rbf[:2]*quadratic[2:3]+linear": shapes on
columns of x, every factor with a length scale per column, every term with an amplitude.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from re import fullmatch
from typing import Any

import numpy as np

from planner.errors import InputError

Shape = Callable[[Any, Any, Any], Any]
MATRIX_PAIRS = 10_000  # pairs from which a matrix product pays in XLA too


def _squared_distance(xp: Any, xa: Any, xb: Any) -> Any:
    if xp is np or xa.shape[-2] * xb.shape[-2] >= MATRIX_PAIRS:
        # One matrix product. Cancellation leaves an error of 1e-16 |x|² in r²; the kernels are
        # smooth functions of r², so it stays that small.
        one_a, one_b = xp.ones_like(xa[..., :1]), xp.ones_like(xb[..., :1])
        a = xp.concatenate([xa, one_a, xp.sum(xa**2, axis=-1, keepdims=True)], axis=-1)
        b = xp.concatenate([-2 * xb, xp.sum(xb**2, axis=-1, keepdims=True), one_b], axis=-1)
        return xp.maximum(a @ xp.swapaxes(b, -1, -2), 0.0)
    total = 0.0  # small batched products are slow in XLA; differences fuse
    for i in range(xa.shape[-1]):
        total = total + (xa[..., :, None, i] - xb[..., None, :, i]) ** 2
    return total


def bias(xp: Any, xa: Any, xb: Any) -> Any:
    """Constant (Busch et al. 2022, eq. 8)."""
    return xp.ones_like(xa[..., :, None, 0] * xb[..., None, :, 0])


def polynomial(degree: int) -> Shape:
    """(x·x') to a power (Busch et al. 2022, eqs. 4 to 6)."""
    return lambda xp, xa, xb: (xa @ xp.swapaxes(xb, -1, -2)) ** degree


def rbf(xp: Any, xa: Any, xb: Any) -> Any:
    """exp(−r²/2) (Busch et al. 2022, eq. 7)."""
    return xp.exp(-_squared_distance(xp, xa, xb) / 2)


def matern52(xp: Any, xa: Any, xb: Any) -> Any:
    """Matérn 5/2."""
    squared = _squared_distance(xp, xa, xb)
    if xp is not np:
        # √ has no slope at 0, so gradients there would be undefined. Asking twice whether r² is 0
        # will not do: XLA computes it anew in each place, by fused operations that leave 1e-33 in
        # one.
        squared = xp.maximum(squared, 1e-30)
    r = 5.0**0.5 * xp.sqrt(squared)
    return (1 + r * (1 + r * (1 / 3))) * xp.exp(-r)  # XLA would divide every time


KERNELS: dict[str, Shape] = {
    "bias": bias, "linear": polynomial(1), "quadratic": polynomial(2), "cubic": polynomial(3),
    "rbf": rbf, "matern52": matern52,
}  # fmt: skip
SCALELESS = frozenset({"bias"})


@dataclass(frozen=True)
class Factor:
    """One shape on the columns start … stop − 1 of x; its length scales are a slice of θ."""

    name: str
    columns: slice
    scales: slice

    def points(self, xp: Any, theta: Any, x: Any) -> Any:
        """x (…, a, d) as the shape wants it, θ (…, p)."""
        if self.name in SCALELESS:
            return x
        return x[..., self.columns] / xp.exp(theta[..., None, self.scales])


@dataclass(frozen=True)
class Kernel:
    """Σ σ_t² Π factors over d columns; θ = (log σ_1, log τ, scales of term 1, log σ_2, …).

    τ, the nugget, has its place in θ but is no part of the kernel.
    """

    terms: tuple[tuple[Factor, ...], ...]
    amplitudes: tuple[int, ...]
    size: int

    def covariance(self, xp: Any, theta: Any, xa: Any, xb: Any) -> Any:
        """(…, a, b) of xa (a, d), xb (b, d) at θ (…, p)."""
        products = []
        for place, term in zip(self.amplitudes, self.terms, strict=True):
            product = xp.exp(2 * theta[..., place, None, None])
            for f in term:
                a, b = f.points(xp, theta, xa), f.points(xp, theta, xb)
                product = product * KERNELS[f.name](xp, a, b)
            products.append(product)
        return products[0] if len(products) == 1 else sum(products)

    def variance(self, xp: Any, theta: Any, x: Any) -> Any:
        """Diagonal (…, a) of the covariance of x (a, d)."""
        each = x[..., :, None, :]
        return self.covariance(xp, theta[..., None, :], each, each)[..., 0, 0]

    def prior(
        self, amplitude: float, nugget: float, length: float, spread: float, length_spread: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean and sd (p,) of θ: medians of σ, τ with log-sd `spread`, of ℓ `length`·√width."""
        mean, sd = np.full(self.size, np.log(amplitude)), np.full(self.size, spread)
        mean[1] = np.log(nugget)
        for term in self.terms:
            for f in term:
                width = f.scales.stop - f.scales.start
                mean[f.scales] = np.log(length * np.sqrt(max(width, 1)))
                sd[f.scales] = length_spread
        return mean, sd


def perdikaris(d: int, shape: str = "rbf") -> str:
    """Expression k_ρ(x) k_f(l) + k_δ(x) over (x_1 … x_d, l), l of a level below: NARGP."""
    return f"{shape}[0:{d}]*{shape}[{d}:{d + 1}]+{shape}[0:{d}]"


def kennedy_ohagan(d: int) -> str:
    """Expression σ² l l' + k_δ(x) over the same columns: AR1."""
    return f"linear[{d}:{d + 1}]+rbf[0:{d}]"


@lru_cache(maxsize=256)
def parse(expression: str, d: int) -> Kernel:
    """Kernel over d columns; InputError if the expression is not understood.

    Factors are `name` or `name[a:b]` (columns a … b − 1), joined by `*`, terms by `+`.
    """
    terms, amplitudes, size = [], [], 0
    for t, term in enumerate(expression.replace(" ", "").split("+")):
        amplitudes.append(size)
        size += 2 if t == 0 else 1
        factors = []
        for text in term.split("*"):
            match = fullmatch(r"(\w+)(?:\[(\d*):(\d*)\])?", text)
            if match is None or match[1] not in KERNELS:
                raise InputError(
                    f"Kernel {expression!r}: {text!r} is none; write sums and products of "
                    f"{', '.join(KERNELS)}, on columns as in rbf[0:2]."
                )
            start, stop, _ = slice(int(match[2] or 0), int(match[3] or d)).indices(d)
            width = 0 if match[1] in SCALELESS else max(stop - start, 0)
            factors.append(Factor(match[1], slice(start, stop), slice(size, size + width)))
            size += width
        terms.append(tuple(factors))
    return Kernel(tuple(terms), tuple(amplitudes), size)
