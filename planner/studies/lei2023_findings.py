"""What Lei et al. 2023 found, and whether it holds on simulated hits."""

import numpy as np

from planner.studies.lei2023_cost import MOST_DIRECT, PAPER_S
from planner.studies.lei2023_groups import PAPER_MODELS, PARTS
from planner.studies.lei2023_scores import (
    ALONE,
    AT_ONCE,
    BY_KIND,
    GROUPS,
    KNOWN,
    RobotScores,
    apart,
    median,
    shares,
)
from planner.studies.report import PaperClaim, Table

MOSTLY = 0.9  # of the parameters, where the paper says "in all the prediction cases"
SOARS = 10  # times the cost of three tasks, at five: the paper has 26


def findings(scores: list[RobotScores], cost: Table) -> tuple[PaperClaim, ...]:
    """From R² of all robots, and from the table of costs."""
    return (*_about_accuracy(scores), *_about_models(scores), *_about_cost(scores, cost))


def _about_accuracy(scores: list[RobotScores]) -> tuple[PaperClaim, ...]:
    (better, steadier), (known_better, known_steadier) = (
        shares(scores, w) for w in (GROUPS, KNOWN)
    )
    ours = {way: shares(scores, way)[0] for way in (BY_KIND, AT_ONCE)}
    return (
        PaperClaim(
            "In groups of three, parameters are predicted better than one by one (mean R²).",
            f"{100 * better:.0f} % of those that scatter does not bury; median R² "
            f"{median(scores, GROUPS):.3f} in groups, {median(scores, ALONE):.3f} one by one",
            better > MOSTLY,
            f"R² differ by {apart(scores, GROUPS):.3f} in the median: of parameters measured at "
            "the same postures with little noise, one task tells the others nothing (Bonilla et "
            "al. 2008)"
            if apart(scores, GROUPS) < 0.02
            else f"R² differ by {apart(scores, GROUPS):.3f} in the median, to both sides",
        ),
        PaperClaim(
            "The same, read so that the group's other parameters are known at tested postures.",
            f"better in {100 * known_better:.0f} %, steadier in {100 * known_steadier:.0f} %; "
            f"median R² {median(scores, KNOWN):.3f}",
            min(known_better, known_steadier) > MOSTLY,
            f"in {100 * (1 - known_better):.0f} % the others tell less than is lost by sharing "
            "length scales",
        ),
        PaperClaim(
            "In groups they are predicted more steadily (spread of R² over folds).",
            f"in {100 * steadier:.0f} % of them",
            steadier > MOSTLY,
            f"in {100 * (1 - steadier):.0f} % the folds differ as much or more",
        ),
        PaperClaim(
            "Larger groups than the paper's predict better than one by one.",
            f"by kind in {100 * ours[BY_KIND]:.0f} %, all at once in {100 * ours[AT_ONCE]:.0f} %; "
            f"median R² {median(scores, BY_KIND):.3f} and {median(scores, AT_ONCE):.3f}",
            min(ours.values()) > 0.5,
            "one set of length scales for all loses "
            f"{median(scores, ALONE) - median(scores, AT_ONCE):.3f} of R² in the median",
            ours=True,
        ),
    )


def _about_models(scores: list[RobotScores]) -> tuple[PaperClaim, ...]:
    count, models = PARTS * len(scores[0].labels), scores[0].models
    f, zeta = (
        np.concatenate([s.off[kind].ravel() for s in scores])
        for kind in ("frequency", "damping ratio")
    )
    return (
        PaperClaim(
            "Groups halve the number of models (70 for 144 parameters).",
            f"{models} for {count}",
            models <= PAPER_MODELS / 144 * count + 1,
            "fewer modes are found, which leaves smaller groups",
        ),
        PaperClaim(
            "Frequencies are predicted better than damping ratios, all within 10 %.",
            f"mean error {np.nanmean(f):.2f} and {np.nanmean(zeta):.1f} %, largest "
            f"{np.nanmax(f):.1f} and {np.nanmax(zeta):.0f} %",
            bool(np.nanmean(f) < np.nanmean(zeta) and max(np.nanmax(f), np.nanmax(zeta)) < 10),
            f"{100 * np.nanmean(zeta > 10):.0f} % of the damping ratios and "
            f"{100 * np.nanmean(f > 10):.1f} % of the frequencies are off by more; the paper looks "
            "at three postures",
        ),
    )


def _about_cost(scores: list[RobotScores], cost: Table) -> tuple[PaperClaim, ...]:
    rows = {int(float(row[0])): row for row in cost.rows}
    most = max(rows)
    seconds = max(s.seconds[BY_KIND] for s in scores)
    whole = max(s.seconds[AT_ONCE] for s in scores)
    trained, direct = ({m: float(rows[m][i]) for m in rows} for i in (1, 2))
    grown = trained[most] / max(trained[3], 1e-9)
    count = PARTS * len(scores[0].labels)
    return (
        PaperClaim(
            "Training time soars where more than three parameters are trained together.",
            f"{most} at once: {trained[most]:.2f} s by Kronecker's structure, {grown:.1f} times "
            f"that of three; one direct Cholesky factor of {MOST_DIRECT}: "
            f"{direct[MOST_DIRECT] / max(direct[3], 1e-9):.0f} times that of three",
            grown > SOARS,
            "every parameter is measured at every posture, so that two small eigendecompositions "
            f"do what one large factor did: {most} cost {grown:.1f} times as much as three",
        ),
        PaperClaim(
            f"{count} parameters train in less time than the paper's group of three "
            f"({PAPER_S[3]} s).",
            f"{seconds:.2f} s by kind, {whole:.2f} s all at once, of one processor; "
            f"{scores[0].models} groups {max(s.seconds[GROUPS] for s in scores):.1f} s",
            min(seconds, whole) < PAPER_S[3],
            f"the quicker takes {min(seconds, whole):.1f} s on this machine",
            ours=True,
        ),
    )
