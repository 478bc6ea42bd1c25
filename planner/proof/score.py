"""Scores of single diagnoses against their unsealed answers."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from planner.diagnosis.thresholds import ARTEFACTS
from planner.frf import metrics
from planner.robot.config import DiagnoseTable

BINS = 10
Z90 = 1.645
DETECTABLE = 5.0  # nats: below, not to name an effect is right; e⁵ is odds of 150
MATTERS = DiagnoseTable().matters  # of |H|: what a diagnosis need not explain
LARGEST_SET = 2  # places that can't be told apart and yet count as told

Place = tuple[str, str | None]
NOTHING: frozenset[tuple[str, str | None]] = frozenset({("none", None), ("unknown", None)})


@dataclass(frozen=True)
class Shown:
    """A concealed effect: how much tells of it, and what the answer made of it.

    `nats`: with the robot's own numbers refitted, hits and chain known; `nats_open`: those unknown
    too. `left`: by how much of |H| a refitted robot without it is off. `named`: effect and place
    are named; `in_set`: or they are in a set of at most two that can't be told apart.
    """

    effect: str
    at: str | None
    nats: float
    nats_open: float
    named: bool
    in_set: bool
    left: float

    @property
    def matters(self) -> bool:
        """Whether the recordings tell of it, and a refitted robot would be off by what matters."""
        return self.nats_open >= DETECTABLE and self.left >= MATTERS


@dataclass(frozen=True)
class Scored:
    """One case: what was concealed, what was said first and how surely, whether that is right.

    `group` is null, single, artefact, pair or outsider. `said` is the first candidate, `named` what
    is told as there, `false_names` what of it is not there. `right`: what was said first is what
    was concealed; what nothing tells of (DETECTABLE) may be left out. `holds`: the same, where a
    small imperfection of the robot may be said too, for it is there. `fair`: what `holds`, and what
    says all that matters and nothing that is not there: "consistent" means no more than that a
    refitted robot is off by less than what matters. `detectability` is the smallest relative change
    of the spectra by an effect; `covered` counts parameters inside and all that can be compared;
    `frac` is global FRAC of the predictions with the true FRFs.
    """

    name: str
    group: str
    robot: str
    true: tuple[Place, ...]
    said: tuple[Place, ...]
    named: tuple[Place, ...]
    false_names: tuple[Place, ...]
    verdict: str
    shown: tuple[Shown, ...]
    probability: float
    right: bool
    holds: bool
    fair: bool
    detectability: float
    covered: tuple[int, int]
    frac: float
    seconds: float
    own_held_out: tuple[float, float]  # refitted, explained


def score(name: str, answer: dict[str, Any], told: dict[str, Any]) -> Scored:
    """Score one case; one that failed is wrong, with certainty."""
    true = tuple(_place(e) for e in answer["effects"])
    group, changes = _group(answer, true), [e["change"] for e in answer["effects"]]
    change = min(changes, default=0.0)
    if "failed" in told:
        shown = tuple(_shown(e, False, False) for e in answer["effects"])
        return Scored(
            name, group, answer["robot"], true, (("failed", None),), (), (), "failed", shown,
            1.0, False, False, False, change, (0, 0), np.nan, np.nan, (np.nan, np.nan),
        )  # fmt: skip
    first = told["candidates"][0]
    said = tuple(_place(e) for e in first["effects"])
    named = _named(told, said)
    sets = [frozenset(_place(e) for e in members) for members in told.get("sets") or ()]
    pairs = [members for members in sets if len(members) <= LARGEST_SET]
    wide = {p: {q for s in pairs if p in s for q in s} for p in {*true, *named}}
    shown = tuple(
        _shown(e, _place(e) in named, bool(wide[_place(e)] & set(named))) for e in answer["effects"]
    )
    small = {_place(e) for e in answer.get("imperfections", ())}
    there = {*true, *small}
    rest = tuple(p for p in said if p not in small or p in true)
    held = told["held_out"]
    holds = _right(answer, shown, rest)
    fair = holds or _fair(shown, said, there)
    own = tuple(
        float("nan") if held[k]["frac"] is None else held[k]["frac"]
        for k in ("refitted", "explained")
    )
    return Scored(
        name, group, answer["robot"], true, said, named,
        tuple(p for p in named if p not in there and not wide[p] & there),
        told["verdict"], shown, first["probability"], _right(answer, shown, said),
        holds, fair, change, _covered(answer, told), _frac(answer, told),
        told["seconds"], (own[0], own[1]),
    )  # fmt: skip


def _place(effect: dict[str, Any]) -> Place:
    return effect["effect"], effect["at"]


def _shown(effect: dict[str, Any], named: bool, in_set: bool) -> Shown:
    nats, opened = effect["nats"], effect["nats_open"]
    left = effect.get("left", effect["change"])  # proofs of old did not ask
    return Shown(effect["effect"], effect["at"], nats, opened, named, named or in_set, left)


def _named(told: dict[str, Any], said: Sequence[Place]) -> tuple[Place, ...]:
    """What an engineer reads as being there; nothing where all is said to be consistent."""
    if told["verdict"] == "consistent":
        return ()
    findings = [_place(f) for f in told["findings"]]
    first = said if told["verdict"] == "explained" else ()
    return tuple(dict.fromkeys(p for p in (*first, *findings) if p not in NOTHING))


def _right(answer: dict[str, Any], shown: Sequence[Shown], said: Sequence[Place]) -> bool:
    """Whether all that can be told is said first, and nothing that is not there."""
    claimed, unknown = {p for p in said if p not in NOTHING}, ("unknown", None) in said
    known = {(s.effect, s.at) for s in shown}
    wanted = {(s.effect, s.at) for s in shown if s.nats_open >= DETECTABLE}
    if not known or ("unknown", None) in wanted:
        return not claimed and unknown == bool(wanted)
    return wanted <= claimed <= known


def _fair(shown: Sequence[Shown], said: Sequence[Place], there: set[Place]) -> bool:
    """Whether what is said is `there`, and nothing that matters is left unsaid."""
    matter = {(s.effect, s.at) for s in shown if s.matters}
    return matter <= set(said) and all(p in there for p in said if p != ("none", None))


def _group(answer: dict[str, Any], true: Sequence[Place]) -> str:
    if not true:
        return "null"
    if answer["outside_library"]:
        return "outsider"
    if len(true) > 1:
        return "pair"
    return "artefact" if true[0][0] in ARTEFACTS else "single"


def _covered(answer: dict[str, Any], told: dict[str, Any]) -> tuple[int, int]:
    inside = known = 0
    for effect in answer["effects"]:
        for finding in told["findings"]:
            if (finding["effect"], finding["at"]) != (effect["effect"], effect["at"]):
                continue
            for true, value, sd in _pairs(effect, finding["parameters"]):
                known += 1
                inside += abs(value - true) <= Z90 * sd
    return inside, known


def _pairs(effect: dict[str, Any], found: dict[str, Any]) -> list[tuple[float, float, float]]:
    """(true, value, sd) of the parameters that mean the same on both sides."""
    true, kind = effect["parameters"], effect["effect"]
    names = {
        "local_resonator": {"mass": "mass", "frequency_hz": "frequency"},
        "added_mass": {"mass": "mass"},
        "sensor_gain": {"gain": "gain"},
        "channel_delay": {"delay_s": "delay"},
    }.get(kind, {})
    out = [(true[a], found[b]) for a, b in names.items() if b in found]
    stiff = {n: v for n, v in found.items() if n.startswith("stiffness")}
    if kind == "base_compliance":
        for axis, k in zip("xy", true["stiffness"], strict=True):
            out += [(k, v) for n, v in stiff.items() if n.endswith(f"about {axis}")]
    if kind == "joint_stiffness" and len(stiff) == 1:
        out += [(true["stiffness"], v) for v in stiff.values()]
    if kind == "exponential_window" and "rate" in found:
        out.append((1 / true["time_constant_s"], found["rate"]))
    if kind == "structural_damping":
        out += [(true["loss_factor"], v) for n, v in found.items() if n.startswith("loss")]
    return [(float(t), v["value"], v["sd"]) for t, v in out]


def _frac(answer: dict[str, Any], told: dict[str, Any]) -> float:
    """Of the predictions with the true FRFs at poses that were never given."""
    if not told.get("npz") or not Path(told["npz"]).is_file():
        return float("nan")
    true = answer["held_out"]
    with np.load(told["npz"]) as file:
        lines, mean = file["frequency_hz"], np.abs(file["frf_mean"])
    size = np.abs(np.array(true["frf"][0]) + 1j * np.array(true["frf"][1]))
    at = np.array(true["frequency_hz"])
    inside = (at >= lines[0]) & (at <= lines[-1])
    flat = [np.interp(at[inside], lines, row) for row in mean.reshape(-1, len(lines))]
    simulated = np.array(flat).reshape(*mean.shape[:3], -1)
    return metrics.direct_mean(metrics.agreement(size[..., inside], simulated).global_frac)


def by_probability(
    scored: Sequence[Scored], by: str = "right"
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Stated probabilities and what of it was right, by those of BINS equal bins that hold any.

    `by` says what counts as right: "right", "holds" or "fair" of `Scored`.
    """
    p = np.array([s.probability for s in scored])
    right = np.array([getattr(s, by) for s in scored], dtype=float)
    place = np.minimum((p * BINS).astype(int), BINS - 1)
    return [(p[place == k], right[place == k]) for k in np.unique(place)]


def calibration_error(scored: Sequence[Scored], by: str = "right") -> float:
    """Expected calibration error of what was said first; `by` as in `by_probability`."""
    bins = by_probability(scored, by)
    gaps = [abs(p.mean() - right.mean()) * (len(p) / len(scored)) for p, right in bins]
    return float(np.sum(gaps))
