"""Stiffness and damping of a contact, from FRFs of the target tool at one pose.

As the literature does by hand (Özşahin and Altintas 2015; Lei et al. 2023, section 5.3): the
coupled FRFs are brought to the measured ones by the four numbers of the target's contact. Those of
the reference's own stay as stated, for only the difference of the two acts.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from planner.errors import InputError
from planner.milling.coupling import TipReceptance, couple
from planner.milling.tool import NUMBERS, Tool, ToolContact

FARTHEST = np.log(1e3)  # from the numbers stated: the prior's bounds
PRIOR_SD = np.log(10.0)  # of each number around its stated one
STARTS = (0.0, -1.5)  # of stiffnesses, as logarithms beside those stated
KNOWN = np.log(3.0)  # sd of a logarithm from which a number counts as not determined


@dataclass(frozen=True, eq=False)
class ContactFit:
    """The target with its contact, and sds of the logarithms of the four numbers (4,).

    `before` and `after` are the relative misfits as stated and now.
    """

    tool: Tool
    contact: ToolContact
    log_sd: np.ndarray
    before: float
    after: float

    def to_json(self) -> dict[str, object]:
        """Numbers with their sd in percent (None: not determined), misfits in percent."""
        numbers = {
            name: {
                "value": getattr(self.contact, name),
                "sd_percent": None if sd > KNOWN else 100 * float(sd),
            }
            for name, sd in zip(NUMBERS, self.log_sd, strict=True)
        }
        return {
            **numbers,
            "misfit_before_percent": 100 * self.before,
            "misfit_percent": 100 * self.after,
        }


def fit_contact(
    tip: TipReceptance, target: Tool, reference: Tool | None, seen: np.ndarray
) -> ContactFit:
    """From receptances (3, 3, F) measured at the target's tip, NaN where they were not.

    At the lines of `tip`. Raises InputError where the target states no contact to begin with.
    """
    contacts = target.contacts()
    if not contacts:
        raise InputError(
            f"{target.name} has no [segment.contact] to be identified; state one to begin with."
        )
    number, stated = contacts[0]
    known = np.isfinite(seen) & np.isfinite(couple(tip, target, reference).receptance[:3, :3])
    if not np.any(known):
        raise InputError(f"No measured FRF of {target.name} is along a direction of the source.")
    begin = np.log([max(getattr(stated, name), 1e-9) for name in NUMBERS])

    def held(z: np.ndarray) -> Tool:
        values = np.exp(begin + z)
        return target.held(number, ToolContact(*(float(v) for v in values)))

    first = couple(tip, target, reference)
    size = np.abs(np.where(known, seen, 1.0))
    # Relative error that the model is allowed where measured FRFs and coupled ones state less:
    # tools are no rods.
    sd = np.hypot(0.02 * size, np.where(known, first.sd[:3, :3], 0.0))[known]

    def off(z: np.ndarray) -> np.ndarray:
        away = (couple(tip, held(z), reference).receptance[:3, :3] - seen)[known] / sd
        return np.concatenate([away.real, away.imag, z / PRIOR_SD])

    found = None
    for start in STARTS:
        z = np.array([start, start, 0.0, 0.0])
        one = least_squares(off, z, bounds=(-FARTHEST, FARTHEST), x_scale=1.0, max_nfev=60)
        if found is None or one.cost < found.cost:
            found = one
    assert found is not None
    spread = max(2 * found.cost / max(2 * np.count_nonzero(known) - 4, 1), 1.0)
    covariance = np.linalg.inv(found.jac.T @ found.jac) * spread

    def misfit(tool: Tool) -> float:
        error = (couple(tip, tool, reference).receptance[:3, :3] - seen)[known]
        return float(np.linalg.norm(error) / np.linalg.norm(seen[known]))

    best = held(found.x)
    contact = best.contacts()[0][1]
    log_sd = np.sqrt(np.diagonal(covariance))
    return ContactFit(best, contact, log_sd, misfit(target), misfit(best))
