"""Inertias that refitting moved beyond their tolerance: a mass may be hidden in them."""

from planner.diagnosis.linear.other_places import farthest_bent
from planner.diagnosis.linear_diagnosis import Diagnosis
from planner.diagnosis.thresholds import INERTIA_STRAYED


def hidden_inertias(found: Diagnosis) -> tuple[str, ...]:
    """A remark on the link whose inertias had to give most, where nothing else was found."""
    fit = found.candidates[0].fit
    if found.verdict != "consistent" or fit is None:
        return ()
    link, away = farthest_bent(fit)
    if away < INERTIA_STRAYED:
        return ()
    return (
        f"The simulation fits only with inertias of {link} {away:.1f} times their tolerance away "
        f"from the URDF's: a mass there may be hidden in them; check payload, cables and CAD.",
    )
