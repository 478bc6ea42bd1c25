"""Scores of diagnoses against unsealed answers."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from planner.diagnosis.thresholds import ARTEFACTS, LAWS_OF_JOINTS
from planner.frf import metrics

BINS = 10
Z90 = 1.645

Place = tuple[str, str | None]


@dataclass(frozen=True)
class Scored:
    """One case: what was concealed, what was said first and how surely, whether that is right.

    `group` is null, single, artefact, pair or outsider; `detectability` the relative change of
    the FRFs; `covered` counts parameters inside and all that can be compared; `frac` is global
    FRAC of the predictions with the true FRFs.
    """

    name: str
    group: str
    robot: str
    true: tuple[Place, ...]
    said: tuple[Place, ...]
    probability: float
    right: bool
    detectability: float
    covered: tuple[int, int]
    frac: float
    seconds: float
    own_held_out: tuple[float, float]  # refitted, explained


def score(name: str, answer: dict[str, Any], told: dict[str, Any]) -> Scored:
    """Score one case; one that failed is wrong, with certainty."""
    true = tuple((e["effect"], e["at"]) for e in answer["effects"])
    group = _group(answer, true)
    changes = [e["change"] for e in answer["effects"]]
    if "failed" in told:
        return Scored(
            name, group, answer["robot"], true, (("failed", None),), 1.0, False,
            min(changes, default=0.0), (0, 0), np.nan, np.nan, (np.nan, np.nan),
        )  # fmt: skip
    first = told["candidates"][0]
    said = tuple((e["effect"], e["at"]) for e in first["effects"])
    wanted: tuple[Place, ...] = true or (("none", None),)
    held = told["held_out"]
    own = tuple(
        float("nan") if held[k]["frac"] is None else held[k]["frac"]
        for k in ("refitted", "explained")
    )
    return Scored(
        name, group, answer["robot"], true, said, first["probability"],
        sorted(said, key=str) == sorted(wanted, key=str), min(changes, default=0.0),
        _covered(answer, told), _frac(answer, told), told["seconds"], (own[0], own[1]),
    )  # fmt: skip


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


def calibration_error(scored: Sequence[Scored]) -> float:
    """Expected calibration error of what was said first, in BINS equal bins of probability."""
    p = np.array([s.probability for s in scored])
    right = np.array([s.right for s in scored], dtype=float)
    place = np.minimum((p * BINS).astype(int), BINS - 1)
    gaps = [
        abs(p[place == k].mean() - right[place == k].mean()) * np.mean(place == k)
        for k in range(BINS)
        if np.any(place == k)
    ]
    return float(np.sum(gaps))


def summary(scored: Sequence[Scored]) -> dict[str, Any]:
    """All figures of a proof."""

    def share(chosen: Sequence[Scored]) -> dict[str, Any]:
        good = sum(s.right for s in chosen)
        return {"right": good, "of": len(chosen), "share": good / len(chosen) if chosen else None}

    groups = {g: [s for s in scored if s.group == g] for g in sorted({s.group for s in scored})}
    linear = [s for s in groups.get("single", []) if s.true[0][0] not in (*LAWS_OF_JOINTS, "drift")]
    physics = [
        s for s in groups.get("artefact", [])
        if any(name not in (*ARTEFACTS, "unknown", "none") for name, _ in s.said)
    ]  # fmt: skip
    inside, known = np.sum([s.covered for s in scored], axis=0)
    frac = [s.frac for s in scored if np.isfinite(s.frac)]
    worse = [s.own_held_out[1] - s.own_held_out[0] for s in scored]
    return {
        "groups": {name: share(chosen) for name, chosen in groups.items()},
        "single_linear": share(linear),
        "artefacts_called_physics": len(physics),
        "calibration_error": calibration_error(scored),
        "coverage90": {"inside": int(inside), "of": int(known)},
        "held_out_frac_median": float(np.median(frac)) if frac else None,
        "own_held_out": {
            side: float(np.nanmedian([s.own_held_out[k] for s in scored]))
            for k, side in enumerate(("refitted", "explained"))
        },
        "worst_change_by_explaining": float(np.nanmin(worse)),
        "seconds_median": float(np.nanmedian([s.seconds for s in scored])),
        "seconds_most": float(np.nanmax([s.seconds for s in scored])),
    }
