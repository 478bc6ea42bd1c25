"""What a comparison runs, and what each run gives."""

from dataclasses import dataclass

import msgspec

from planner import content_hash
from planner.compare.bench import Bench
from planner.design.propose import check_name
from planner.design.space_filling import NESTED
from planner.errors import InputError
from planner.words import counted

DEFAULT = "default"  # the strategy that `next` uses
BUDGET, LEFT = 15, 2  # measurements; poses that must be left to judge by


class Task(msgspec.Struct, frozen=True):
    """One run: a strategy (an acquisition's name) from the initial poses of a seed to a budget."""

    strategy: str
    seed: int
    initial: int
    budget: int

    def key(self, bench: Bench) -> str:
        """Hash of all that the run's numbers hang on."""
        return content_hash.digest(bench.program, bench.key, content_hash.of(self))


class Run(msgspec.Struct, frozen=True):
    """What a run gave after n = initial … budget measurements, on the poses not yet used.

    `minutes` of robot time until then: travel, settling, hits.
    """

    strategy: str
    seed: int
    poses: tuple[str, ...]
    n: tuple[int, ...]
    frequency_rmse_percent: tuple[float, ...]
    r2: tuple[float, ...]
    coverage95: tuple[float, ...]
    minutes: tuple[float, ...]
    wall_seconds: float
    process_seconds: float


@dataclass(frozen=True)
class Study:
    """Strategies by the names that the user gave, with the acquisition that each one is."""

    strategies: dict[str, str]
    repeats: int
    initial: int
    budget: int

    @classmethod
    def plan(
        cls, bench: Bench, strategies: str, repeats: int, initial: int, budget: int | None
    ) -> "Study":
        """From the command line; InputError where it cannot be done with this pool."""
        asked = [name.strip() for name in strategies.split(",") if name.strip()]
        if not asked:
            raise InputError("--strategies names none; give some, for example random,default.")
        named = {s: bench.config.acquisition.name if s == DEFAULT else s for s in asked}
        for name in named.values():
            if name not in NESTED:
                check_name(name)
        most = len(bench.measurements) - LEFT
        if budget is None and initial > most:
            less = f"give --initial {most} at most, or " if most > 0 else ""
            raise InputError(
                f"The pool has {counted(most + LEFT, 'pose')}: {LEFT} are left to judge by, and "
                f"--initial {initial} needs {initial + LEFT} in all; {less}record more poses."
            )
        budget = min(BUDGET, most) if budget is None else budget
        if budget > most:
            less = f"give {most} at most, or " if most > 0 else ""
            raise InputError(
                f"--budget {budget} leaves less than {LEFT} of the pool's {most + LEFT} poses to "
                f"judge by; {less}record more poses."
            )
        if initial > budget:
            raise InputError(
                f"--initial {initial} is more than --budget {budget}; give fewer initial poses."
            )
        return cls(named, repeats, initial, budget)

    @property
    def tasks(self) -> tuple[Task, ...]:
        """All runs, seed by seed; strategies that are the same acquisition share theirs."""
        names = dict.fromkeys(self.strategies.values())
        seeds = range(self.repeats)
        return tuple(Task(name, s, self.initial, self.budget) for s in seeds for name in names)
