"""What Busch et al. 2020 found, and whether it holds on simulated hits."""

import numpy as np

from planner.studies.busch2020_scores import (
    DIAGNOSED,
    FUSED,
    PAPER_ALL,
    THIN,
    BeyondPrediction,
)
from planner.studies.report import PaperClaim, Table

OURS_AT_LEAST = 0.9
FEWEST_STEP = 3  # every third experiment: 9 of 26 in the paper


def findings(
    scores: Table, thin: Table, robots: Table, predicted: BeyondPrediction
) -> tuple[PaperClaim, ...]:
    """From the tables; `thin` begins with every experiment, except in a small version."""
    r2 = {str(row[0]): float(row[1]) for row in scores.rows}
    both = {str(row[0]): float(row[4]) for row in scores.rows}
    claims = [
        PaperClaim(
            "The simulation alone, which lacks a mode, predicts the FRF poorly (R² 0.353).",
            f"R² {r2['simulation']:.3f}",
            r2["simulation"] < 0.5,
            f"R² is {r2['simulation']:.3f} though a resonance is missing",
        ),
        *_about_both(both),
        _about_extrapolation(r2),
        *_about_sd(predicted),
        _about_few(thin),
        _about_fused(robots),
    ]
    if DIAGNOSED in predicted.amplitude:
        claims.append(
            PaperClaim(
                "The diagnosed simulation extrapolates better than NARGP.",
                f"R² {r2[DIAGNOSED]:.3f} against {r2['NARGP']:.3f}. {predicted.said}",
                r2[DIAGNOSED] > r2["NARGP"],
                f"R² {r2[DIAGNOSED]:.3f} with what the diagnosis adds",
                ours=True,
            )
        )
    return tuple(claims)


def _about_both(both: dict[str, float]) -> list[PaperClaim]:
    named = {
        name: both[name] for name in ("GP", "MFDGP", "NARGP") if np.isfinite(both.get(name, np.nan))
    }
    if len(named) < 3:
        return []
    worst = min(named, key=lambda name: named[name])
    return [
        PaperClaim(
            "Over training and test data GP, MFDGP and NARGP all reach R² above 0.9.",
            ", ".join(f"{n} {v:.3f} ({PAPER_ALL[n]})" for n, v in named.items())
            + ", the paper's in brackets",
            min(named.values()) > 0.9,
            f"{worst} {named[worst]:.3f}: what it predicts beyond the training costs more here",
        )
    ]


def _about_extrapolation(r2: dict[str, float]) -> PaperClaim:
    others = {name: r2[name] for name in ("GP", "MFDGP") if name in r2}
    next_best = max(others, key=lambda name: others[name])
    return PaperClaim(
        "NARGP extrapolates where GP and MFDGP do not (0.982 against 0.785 and 0.758).",
        ", ".join(f"{name} {value:.3f}" for name, value in r2.items()),
        r2["NARGP"] >= 0.95 and others[next_best] < r2["NARGP"],
        f"NARGP as published reaches {r2['NARGP']:.3f}, {next_best} {others[next_best]:.3f}, the "
        f"simulation alone {r2['simulation']:.3f}, modes fused over it {r2[FUSED]:.3f}",
    )


def _about_sd(predicted: BeyondPrediction) -> list[PaperClaim]:
    wider = {
        name: float(predicted.beyond_sd[name][:, -1].mean() / predicted.trained_sd[name].mean())
        for name in ("GP", "MFDGP")
        if name in predicted.beyond_sd
    }
    shown = ", ".join(f"{name} {value:.1f}" for name, value in wider.items())
    return [
        PaperClaim(
            "GP and MFDGP say so: their sd grows from the end of the training on.",
            f"mean sd at 120° over that in the training: {shown}",
            min(wider.values()) > 2,
            f"the least is {min(wider.values()):.1f}",
        )
    ]


def _about_few(thin: Table) -> PaperClaim:
    nargp = [float(row[1 + THIN.index("NARGP")]) for row in thin.rows]
    kept = nargp[:FEWEST_STEP]
    return PaperClaim(
        "NARGP stays accurate with fewer experiments (9 of 26).",
        ", ".join(f"{row[0]} {v:.3f}" for row, v in zip(thin.rows, nargp, strict=True)),
        min(kept) >= 0.9,
        f"the least R² is {min(kept):.3f}, the first {nargp[0]:.3f}",
    )


def _about_fused(robots: Table) -> PaperClaim:
    least = min(float(v) for row in robots.rows for v in row[1:-1])
    return PaperClaim(
        f"Fused modes extrapolate to R² ≥ {OURS_AT_LEAST}, with every 4th experiment too.",
        f"least R² over {len(robots.rows)} robots and all steps {least:.3f}",
        least >= OURS_AT_LEAST,
        f"the least is {least:.3f}",
        ours=True,
    )
