"""What a comparison runs, and what each run gives."""

from dataclasses import dataclass

import msgspec

from planner import content_hash
from planner.compare.bench import Bench
from planner.design.propose import check_name
from planner.design.space_filling import NESTED
from planner.errors import InputError
from planner.surrogate.frequency_models import check_choice
from planner.words import counted

DEFAULT = "default"  # the strategy that `next` uses
BUDGET, LEFT = 15, 2  # measurements; poses that must be left to judge by


class Task(msgspec.Struct, frozen=True):
    """One run: a strategy (an acquisition's name) from the initial poses of a seed to a budget.

    `model` is a name of `[surrogate] model`, "" the campaign's own.
    """

    strategy: str
    seed: int
    initial: int
    budget: int
    model: str = ""

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
    model: str = ""


@dataclass(frozen=True)
class Study:
    """Acquisition and model ("": the campaign's) of each strategy, by the names that users gave."""

    strategies: dict[str, tuple[str, str]]
    repeats: int
    initial: int
    budget: int

    @classmethod
    def plan(
        cls, bench: Bench, strategies: str | None, models: str | None, repeats: int, initial: int,
        budget: int | None,
    ) -> "Study":  # fmt: skip
        """From the command line; InputError where it cannot be done with this pool."""
        if strategies is None and models is None:
            raise InputError("Nothing is compared: give --strategies A,B or --models A,B.")
        asked = _names("--strategies", strategies, "random,default", [DEFAULT])
        chosen = _names("--models", models, "default,gp,ar1", [""])
        table = bench.config.surrogate
        for model in chosen:
            simulated = bench.config.fidelity.simulation != "none"
            check_choice(model or table.model, table.kernel, simulated, "--models")
        each = [(s, bench.config.acquisition.name if s == DEFAULT else s) for s in asked]
        for _, name in each:
            if name not in NESTED:
                check_name(name)
        one = len(asked) == 1 and models is not None
        pairs = {m if one else f"{s}/{m}".strip("/"): (name, m) for s, name in each for m in chosen}
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
        return cls(pairs, repeats, initial, budget)

    @property
    def tasks(self) -> tuple[Task, ...]:
        """All runs, seed by seed; strategies that are the same acquisition share theirs."""
        return tuple(
            Task(name, seed, self.initial, self.budget, model)
            for seed in range(self.repeats)
            for name, model in dict.fromkeys(self.strategies.values())
        )


def _names(option: str, given: str | None, example: str, default: list[str]) -> list[str]:
    found = [name.strip() for name in (given or "").split(",") if name.strip()]
    if given is not None and not found:
        raise InputError(f"{option} names none; give some, for example {example}.")
    return found or default
