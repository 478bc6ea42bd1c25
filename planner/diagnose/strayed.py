"""Springs that a nonlinear fit moved far from where robot.toml states them."""

import numpy as np

from planner.diagnose.effects.stiffness import JointStiffness
from planner.diagnose.finding import Finding
from planner.diagnose.fit import Fit

FAR = 3.2  # prior sds that a spring does not move by chance, nor by what a fit in time neglects
MOST = 1  # joints that may be: several at once imitate what the law lacks
FITS = 2.0  # χ² per value up to which a law is the joint's own; else springs imitate what it lacks


def strayed(
    plain: Fit, x: np.ndarray, sd: np.ndarray, nonlinear: str, per_value: float
) -> tuple[Finding, ...]:
    """Joints other than the nonlinear one whose springs are far off at x (D,) ± sd (D,).

    x is laid out as that of `plain`; a nonlinear joint's own spring is part of its law, which
    fits to `per_value`.
    """
    if per_value > FITS:
        return ()
    misfit = plain.misfit
    simulation = misfit.setting.simulation
    names = [p.name for p in misfit.parametrisation.parameters]
    away = (x - misfit.mean) / misfit.sd
    found: dict[str, Finding] = {}
    for effect in JointStiffness.everywhere(simulation):
        springs = [name for name in effect.springs(simulation) if name in names]
        far = [name for name in springs if abs(away[names.index(name)]) > FAR]
        if not far or effect.at == nonlinear or effect.at in found:
            continue
        places = [names.index(name) for name in far]
        value = np.exp(x[places])
        told = {
            name: (float(v), float(v * sd[i]), "N·m/rad")
            for name, v, i in zip(far, value, places, strict=True)
        }
        evidence = float(np.max(away[places] ** 2)) / 2
        found[effect.at] = Finding("joint_stiffness", effect.at, evidence, told, effect.text(told))
    return tuple(found.values()) if len(found) <= MOST else ()
