"""Values of several poses that are taken apart and put together pose by pose."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np


class PerPose:
    """A dataclass whose entries are arrays with the poses first, others of its kind, or None."""

    def __getitem__(self, poses: Any) -> Self:
        """Those of some poses, or of what else NumPy's index says of each array."""
        return type(self)(*(v if v is None else v[poses] for v in vars(self).values()))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Those of the poses of all parts, in their order."""
        return cls(*map(np.concatenate, zip(*(vars(part).values() for part in parts), strict=True)))

    def replaced(self, poses: np.ndarray, other: Self) -> Self:
        """With those of `other` at some of the poses; None where either has none."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return type(self)(*(_put(own, poses, new) for own, new in pairs))


def _put(own: Any, poses: np.ndarray, new: Any) -> Any:
    if own is None or new is None:
        return None
    if isinstance(own, PerPose):
        return own.replaced(poses, new)
    out = own.copy()
    out[poses] = new
    return out
