"""What Seyed Hosseini et al. 2025 found, and whether it holds on simulated hits."""

import numpy as np

from planner.studies.report import PaperClaim, Table
from planner.studies.seyedhosseini2025_data import FREQUENCY, PostureData

RIGHT = 0.03  # relative error of a frequency that is the mode's own


def findings(
    errors: Table, models: Table, steps: Table, correlation: Table, quality: Table,
    seconds: float, data: PostureData,
) -> tuple[PaperClaim, ...]:  # fmt: skip
    """From the tables, and from what is known of the data."""
    columns = np.array([row[1:] for row in errors.rows], float).T
    f, zeta, residues, mse, inside = columns[:5]
    turned = np.abs(np.corrcoef(data.q.T)[0])
    wrong = _wrongly(data)
    strength = np.abs([row[1:4] for row in correlation.rows]).max(axis=1)
    r2 = np.array([row[1:] for row in quality.rows], float)
    step = {str(row[0]): float(row[1]) for row in steps.rows}
    multi, single = (np.array(row[1:], float) for row in models.rows)
    return (
        PaperClaim(
            "Joints 2 and 3 matter far more to modes 1 to 3 than joint 1.",
            "largest |correlation| of joints 1 to 6: " + ", ".join(f"{v:.2f}" for v in strength),
            bool(min(strength[1], strength[2]) > 2 * strength[0]),
            "on this trajectory joint 1 turns together with joint "
            f"{int(np.argsort(turned)[-2]) + 1} (correlation {np.sort(turned)[-2]:.2f})",
        ),
        PaperClaim(
            "The four-step check makes modal parameters reliable.",
            f"largest error of a frequency {step['f off by, before: largest %']:.1f} % before, "
            f"{step['f off by, after: largest %']:.1f} % after; "
            f"{step['dropped by the check']:.0f} dropped, "
            f"{step['recovered by neighbours']:.0f} recovered",
            step["f off by, after: largest %"] <= step["f off by, before: largest %"],
            wrong,
        ),
        PaperClaim(
            "A GP over joint angles predicts the last 15 postures' modal parameters accurately.",
            f"frequencies off by {f.mean():.2f} %, {inside.mean():.0f} % inside their 95 % "
            f"interval; MSE of all parameters, scaled, {mse.mean():.3f} (0.00387); fitted in "
            f"{seconds:.1f} s",
            bool(f.mean() < 2.0 and inside.mean() > 75),
            f"mode {int(np.argmax(f)) + 1} is off by {f.max():.1f} %"
            if f.mean() >= 2.0
            else f"the intervals are too narrow for mode {int(np.argmin(inside)) + 1}: "
            f"{inside.min():.0f} % inside",
        ),
        PaperClaim(
            "Damping ratios are predicted less surely than frequencies.",
            f"off by {zeta.mean():.1f} % against {f.mean():.2f} %",
            bool(zeta.mean() > f.mean()),
            f"damping is {f.mean() / max(zeta.mean(), 1e-9):.1f} times surer",
        ),
        PaperClaim(
            "FRFs put together from predicted modes agree with those measured.",
            f"R² of |H| at two postures from {r2.min():.3f} to {r2.max():.3f}",
            bool(r2.min() > 0.9),
            f"the least is {r2.min():.2f}, with damping ratios off by {zeta.mean():.0f} % and "
            f"residues by {residues.mean():.0f} %",
        ),
        PaperClaim(
            "GPs together within a kind predict better than one GP an output, as published.",
            f"frequencies off by {multi[0]:.2f} against {single[0]:.2f} %, damping by "
            f"{multi[1]:.1f} against {single[1]:.1f} %",
            bool(multi[0] < single[0]),
            f"errors are {multi[0] / single[0]:.2f} (frequency) and {multi[1] / single[1]:.2f} "
            "(damping) times those of one GP an output",
            ours=True,
        ),
    )


def _wrongly(data: PostureData) -> str:
    """How many modes that the check dropped were right, and how many that it recovered are not."""
    true = data.clean[:, FREQUENCY]
    with np.errstate(invalid="ignore"):
        before = np.abs(np.log(data.unchecked_hz) - true) < RIGHT
        after = np.abs(data.measured[:, FREQUENCY] - true) < RIGHT
    dropped, recovered = data.checked.doubted & before, data.checked.recovered & ~after
    return (
        f"{dropped.sum()} of {data.checked.doubted.sum()} that it drops were within 3 % of the "
        f"truth, {recovered.sum()} of {data.checked.recovered.sum()} that it recovers are not"
    )
