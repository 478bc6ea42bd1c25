"""Structures found for the first measurements of a campaign, from which later fits begin.

What is found of n measurements begins where that of the first 1, 2, 3, 4, 6, 8, 12, … led: so it is
a function of the measurements in their order alone, whatever was computed before, and each step
costs little. It is kept in memory, and on disk where there is a store.
"""

import pickle
from collections.abc import Callable
from dataclasses import dataclass, field

from planner.campaign.state import Measurement
from planner.dataset.store import Store
from planner.fit.fitted import FitRecord

Used = tuple[Measurement, ...]


def steps(count: int) -> tuple[int, ...]:
    """Of how many measurements something is found before that of so many: 1, 2, 3, 4, 6, 8, 12."""
    found, power = {1}, 2
    while power < count:
        found |= {power, power + power // 2}
        power *= 2
    return tuple(sorted(n for n in found if n < count))


@dataclass(frozen=True, eq=False)
class FitMemory:
    """Kept by the measurements that they are of; `name` gives the key of an entry on disk."""

    store: Store = field(default_factory=lambda: Store(None))
    name: Callable[[Used], str] = lambda used: ""
    kept: dict[Used, FitRecord] = field(default_factory=dict)

    def get(self, used: Used) -> FitRecord | None:
        """What was found of these, where that is known."""
        if used not in self.kept and self.store.folder is not None:
            data = self.store.get(self.name(used), bytes)
            try:
                found = None if data is None else pickle.loads(data)  # this user's own file
            except Exception:  # whatever a library makes of it, it is found again
                found = None
            if isinstance(found, FitRecord):
                self.kept[used] = found
        return self.kept.get(used)

    def put(self, used: Used, found: FitRecord) -> None:
        """Keep what was found."""
        self.kept[used] = found
        if self.store.folder is not None:
            self.store.put(self.name(used), pickle.dumps(found, pickle.HIGHEST_PROTOCOL))
