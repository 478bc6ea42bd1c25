"""Scores of single diagnoses against their unsealed answers.

Of each concealed effect the answer has `size`, what the best robot without it leaves of |H| at
poses set aside, and `nats`, what the recordings tell of that (see `refit`). With m what matters:

- required: at least DETECTABLE_NATS and 1.5 m; it is right if named and placed, or in a set of two;
- silence is required where nothing has 0.67 m; between, either is right;
- a false name is of nothing that was concealed, nor of an imperfection of at least 0.5 m;
- "unexplained" is right where an effect without a name has 1.5 m, "consistent" where nothing does.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.effects.chain import ARTEFACTS
from planner.robot.config import DiagnoseTable

MATTERS = DiagnoseTable().matters  # of |H|: what a diagnosis need not explain
# Apart by more than sizes err.
CLEARLY, HARDLY, LEAST = 1.5 * MATTERS, 0.67 * MATTERS, 0.5 * MATTERS
DETECTABLE_NATS = 20.0
LARGEST_SET = 2  # places that can't be told apart and yet count as told
BINS = 10
Z90, Z95 = 1.645, 1.96

Place = tuple[str, str | None]
UNKNOWN: Place = ("unknown", None)
NOTHING = frozenset({("none", None), UNKNOWN})


@dataclass(frozen=True)
class ScoredEffect:
    """A concealed effect, and whether it is named and placed, alone or in a set of two."""

    effect: str
    at: str | None
    nats: float
    size: float
    named: bool
    in_set: bool

    @property
    def required(self) -> bool:
        """Whether it must be told: by its name, or as unknown."""
        return self.nats >= DETECTABLE_NATS and self.size >= CLEARLY

    @property
    def has_name(self) -> bool:
        """Whether the library has one for it."""
        return (self.effect, self.at) != UNKNOWN


@dataclass(frozen=True)
class Scored:
    """One case: what was concealed, what was said and how surely, whether that is right.

    `group` is null, single, artefact, pair or outsider. `covered` counts parameters inside their
    90 % interval and all that can be compared; `frac` is FRAC of predictions with the true FRFs.
    `imperfections`: sizes of those that were named.
    """

    name: str
    group: str
    engine: str
    robot: str
    shown: tuple[ScoredEffect, ...]
    verdict: str
    said: tuple[Place, ...]
    named: tuple[Place, ...]
    false_names: tuple[Place, ...]
    probability: float
    right: bool
    covered: tuple[int, int]
    frac: float | None
    seconds: float | None
    imperfections: tuple[float, ...]

    @property
    def silence_required(self) -> bool:
        """Whether nothing that is there matters, as far as its size was asked for."""
        return all(size < HARDLY for size in (*self.imperfections, *(e.size for e in self.shown)))

    @property
    def silent(self) -> bool:
        """Whether all was said to be as it should be."""
        return self.verdict == "consistent"


def score(name: str, answer: Mapping[str, Any], told: Mapping[str, Any]) -> Scored:
    """Score one case; one that failed is wrong, with certainty."""
    true = tuple(_place(e) for e in answer["effects"])
    verdict, failed = told.get("verdict", "failed"), "failed" in told
    first: dict[str, Any] = {"effects": (), "probability": 1.0} if failed else told["candidates"][0]
    said = tuple(_place(e) for e in first["effects"])
    named = _named(told, verdict, said)
    sets = [frozenset(map(_place, members)) for members in told.get("sets") or ()]
    wide = {p: {q for s in sets if p in s and len(s) <= LARGEST_SET for q in s} | {p}
            for p in {*true, *named}}  # fmt: skip
    shown = tuple(
        ScoredEffect(
            e["effect"], e["at"], e["nats"], e["size"], p in named, bool(wide[p] & set(named))
        )
        for e, p in zip(answer["effects"], true, strict=True)
    )
    sizes = {tuple(name.split("@")): size for name, size in told.get("imperfections", {}).items()}
    there = {*true, *(place for place, size in sizes.items() if size >= LEAST)} - NOTHING
    false = tuple(p for p in named if not wide[p] & there)
    right = not false and _right(verdict, shown)
    group = _group(true)
    covered = _covered(answer, told)
    return Scored(
        name, group, answer.get("engine", ""), answer["robot"], shown, verdict, said, named, false,
        first["probability"], right, covered, told.get("frac"), told.get("seconds"),
        tuple(sizes.values()),
    )  # fmt: skip


def named_imperfections(answer: Mapping[str, Any], told: Mapping[str, Any]) -> list[Place]:
    """Imperfections that a diagnosis named: only the size of these matters to its score."""
    if "failed" in told:
        return []
    first = tuple(map(_place, told["candidates"][0]["effects"]))
    named = _named(told, told["verdict"], first)
    return [place for place in map(_place, answer["imperfections"]) if place in named]


def _place(effect: Mapping[str, Any]) -> Place:
    return effect["effect"], effect["at"]


def _named(told: Mapping[str, Any], verdict: str, said: Sequence[Place]) -> tuple[Place, ...]:
    """What an engineer reads as being there; nothing where all is said to be consistent."""
    if verdict not in ("explained", "unexplained"):
        return ()
    first = said if verdict == "explained" else ()
    found = (*first, *map(_place, told["findings"]))
    return tuple(dict.fromkeys(p for p in found if p not in NOTHING))


def _right(verdict: str, shown: Sequence[ScoredEffect]) -> bool:
    """Whether a verdict without false names is right."""
    unknown = [e for e in shown if not e.has_name]
    if verdict == "unexplained":
        return any(e.size >= HARDLY for e in unknown)
    if verdict in ("explained", "consistent"):
        return all(e.in_set for e in shown if e.required)
    return False


def _group(true: Sequence[Place]) -> str:
    if not true:
        return "null"
    if UNKNOWN in true:
        return "outsider"
    if len(true) > 1:
        return "pair"
    return "artefact" if true[0][0] in ARTEFACTS else "single"


def _covered(answer: Mapping[str, Any], told: Mapping[str, Any]) -> tuple[int, int]:
    found = [
        abs(value - true) <= Z90 * sd
        for effect in answer["effects"]
        for finding in told.get("findings", ())
        if _place(finding) == _place(effect)
        for true, value, sd in _pairs(effect, finding["parameters"])
    ]
    return sum(found), len(found)


def _pairs(effect: Mapping[str, Any], found: Mapping[str, Any]) -> list[tuple[float, float, float]]:
    """(true, value, sd) of the parameters that mean the same on both sides."""
    true, kind = effect["parameters"], effect["effect"]
    names = {
        "local_resonator": {"mass": "mass", "frequency_hz": "frequency"},
        "added_mass": {"mass": "mass"},
        "sensor_gain": {"gain": "gain"},
        "channel_delay": {"delay_s": "delay"},
    }.get(kind, {})
    out = [(true[a], found[b]) for a, b in names.items() if a in true and b in found]
    stiff = {n: v for n, v in found.items() if n.startswith("stiffness")}
    if kind == "base_compliance":
        for axis, k in zip("xy", true.get("stiffness", ()), strict=False):
            out += [(k, v) for n, v in stiff.items() if n.endswith(f"about {axis}")]
    if kind == "joint_stiffness" and len(stiff) == 1:
        out += [(true["stiffness"], v) for v in stiff.values()]
    if kind == "exponential_window" and "rate" in found and "time_constant_s" in true:
        out.append((1 / true["time_constant_s"], found["rate"]))
    return [(float(t), v["value"], v["sd"]) for t, v in out]


@dataclass(frozen=True)
class Share:
    """`right` of `of`, with Wilson's 95 % interval; no share of none."""

    right: int
    of: int
    share: float | None
    interval95: tuple[float, float]


def share(right: Sequence[bool]) -> Share:
    """Of those that are right."""
    good, n = sum(map(bool, right)), len(right)
    if n == 0:
        return Share(0, 0, None, (0.0, 1.0))
    p, square = good / n, Z95**2 / n
    middle = (p + square / 2) / (1 + square)
    half = Z95 * np.sqrt(p * (1 - p) / n + square / (4 * n)) / (1 + square)
    return Share(good, n, p, (max(0.0, float(middle - half)), min(1.0, float(middle + half))))


def by_probability(scored: Sequence[Scored]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Stated probabilities and what of it was right, by those of BINS equal bins that hold any."""
    p = np.array([s.probability for s in scored])
    right = np.array([s.right for s in scored], dtype=float)
    place = np.minimum((p * BINS).astype(int), BINS - 1)
    return [(p[place == k], right[place == k]) for k in np.unique(place)]


def calibration_error(scored: Sequence[Scored]) -> float:
    """Expected calibration error of what was said."""
    bins = by_probability(scored)
    return float(sum(abs(p.mean() - right.mean()) * len(p) for p, right in bins) / len(scored))


def figures(scored: Sequence[Scored]) -> dict[str, Any]:
    """All figures of a proof: shares of what is right, calibration, agreement and time."""
    effects = [(s, e) for s in scored for e in s.shown]
    required = [(s, e) for s, e in effects if e.required and e.has_name]
    outside = [s for s, e in effects if e.required and not e.has_name]
    pairs = [s for s in scored if sum(e.required and e.has_name for e in s.shown) == LARGEST_SET]
    counts = [k < s.covered[0] for s in scored for k in range(s.covered[1])]
    artefacts = [s for s in scored if s.group == "artefact"]
    shares: dict[str, Sequence[bool]] = {
        "required_named": [e.named for _, e in required],
        "required_in_set": [e.in_set for _, e in required],
        "silence_where_required": [s.silent for s in scored if s.silence_required],
        "nulls_silent": [s.silent for s in scored if s.group == "null"],
        "cases_with_false_names": [bool(s.false_names) for s in scored],
        "unknown_where_right": [s.verdict == "unexplained" and not s.false_names for s in outside],
        "artefacts_called_physics": [
            any(name not in ARTEFACTS for name, _ in s.false_names) for s in artefacts
        ],
        "both_of_pairs": [all(e.in_set for e in s.shown) for s in pairs],
        "coverage90": counts,
        "failed": [s.verdict == "failed" for s in scored],
    }
    seconds = [s.seconds for s in scored if s.seconds is not None]
    frac = [s.frac for s in scored if s.frac is not None]
    return {
        **{name: share(right) for name, right in shares.items()},
        "by": {
            "group": _by((s.group, s.right) for s in scored),
            "engine": _by((s.engine, s.right) for s in scored),
            "robot": _by((s.robot.rstrip("0123456789").rstrip("-"), s.right) for s in scored),
            "effect": _by((e.effect, e.in_set) for _, e in required),
            "size": _by(
                (f"{10.0 ** np.floor(np.log10(e.size)):.0%} up", e.in_set) for _, e in required
            ),
        },
        "calibration_error": calibration_error(scored),
        "held_out_frac_median": float(np.median(frac)) if frac else None,
        "seconds_median": float(np.median(seconds)) if seconds else None,
        "seconds_most": float(np.max(seconds)) if seconds else None,
    }


def _by(named: Iterable[tuple[str, bool]]) -> dict[str, Share]:
    """What is right of each name."""
    found: dict[str, list[bool]] = {}
    for name, right in named:
        found.setdefault(name, []).append(right)
    return {name: share(found[name]) for name in sorted(found)}
