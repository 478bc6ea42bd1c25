"""How far a fit moved what robot.toml and URDF state, and how likely that is.

Stiffnesses and inertias count. Dampers don't: which share of damping is viscous no data sheet says,
so that they may be anywhere without anything being wrong.
"""

import numpy as np

from planner.diagnosis.effects.effect import Effect
from planner.diagnosis.linear.fit import Fit
from planner.diagnosis.thresholds import PULLED, PULLED_FACTOR, SPRING_STRAYED


def away(fit: Fit, x: np.ndarray, plain: Fit) -> dict[str, float]:
    """By name, in prior sds at x (D,), of what the simulation of `plain`, without effects, has.

    Not of springs that an effect of the fit is about and bodies that it divides: of their parts
    nothing is stated.
    """
    misfit, bodies = fit.misfit, _bodies(plain)
    own = {name for part in fit.effect.parts() for name in part.springs(misfit.setting.simulation)}
    whole = {b for b, values in _bodies(fit).items() if np.array_equal(values, bodies.get(b, ()))}
    springs, inertias = misfit.split
    own |= {p.name for p in plain.misfit.parametrisation.parameters if not p.stated}
    far = (x - misfit.mean) / misfit.sd
    return {
        name: float(far[i])
        for i, name in enumerate(misfit.names[:inertias])
        if (name.startswith("stiffness") and name not in own)
        or (i >= springs and name.split(" of ", 1)[1] in whole)
    }


def _bodies(fit: Fit) -> dict[str, np.ndarray]:
    elastic = fit.misfit.setting.simulation.elastic
    return dict(zip(elastic.bodies, elastic.inertia, strict=True))


def pulled(fit: Fit, x: np.ndarray, plain: Fit) -> float:
    """ln of how much likelier the values at x (D,) are where something unknown pulls at some.

    What a simulation lacks is made up for by what is free in it: each may then have, with
    probability PULLED, an sd of PULLED_FACTOR times its prior's. The spring that is farthest off
    does not count: one alone is that joint's own stiffness, which is no unknown.
    """
    far = away(fit, x, plain)
    squares = np.array(list(far.values())) ** 2
    wider = np.log(PULLED / PULLED_FACTOR) + squares * (1 - PULLED_FACTOR**-2) / 2
    each = np.logaddexp(np.log1p(-PULLED), wider)
    springs = np.array([name.startswith("stiffness") for name in far], dtype=bool)
    return float(np.sum(each) - np.max(each[springs], initial=0.0))


def strayed(fit: Fit, effect: Effect) -> bool:
    """Whether an effect would spare springs that a fit has moved far from where they are stated.

    That costs no χ² that would be left to explain, but the prior's.
    """
    misfit = fit.misfit
    springs = effect.springs(misfit.setting.simulation) if effect.name == "joint_stiffness" else ()
    far = np.abs(fit.x - misfit.mean) / misfit.sd
    names = [p.name for p in misfit.parametrisation.parameters]
    return any(far[names.index(name)] > SPRING_STRAYED for name in springs if name in names)
