"""What a robot stands on moves with it: a block, a bed or a pedestal on springs of its own."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from planner.dynamics.gradient import Impedance
from planner.effects.added_mass import AddedMass
from planner.effects.effect import Gain, Motions, Operator, PosedBodies, Start
from planner.effects.springs import stiffness_told
from planner.words import with_sd

LEVERS = ((3, 1, -1.0), (4, 0, 1.0))  # along x, about y; along y, about x: of the six springs
KNOWN_SD = 2.0  # sds from which it is said to be heavy


@dataclass(frozen=True)
class Foundation(AddedMass):
    """The base's springs (about x, y, z, along x, y, z) and the mass that moves on them with it.

    They come together: without its springs such a mass stands still, and without the mass the
    springs explain less than what imitates both. ψ as an added mass's, but of the mass the
    logarithm, and the height in m of the axes about which the base tilts: of what rocks on its
    foot, that of the foot.
    """

    kind = "foundation"
    effect = "base_compliance"
    absorbed = False

    @property
    def levers(self) -> tuple[tuple[int, int, float], ...]:
        """See `Operator.levers`."""
        return tuple(
            (self.springs[slide], self.springs[turn], sign) for slide, turn, sign in LEVERS
        )

    def impedance(self, poses: PosedBodies, psi: np.ndarray) -> Impedance:
        """The mass's; what the height changes, the springs show."""
        mass = super().impedance(poses, psi)
        return replace(mass, slope=(*mass.slope, ((0, 0.0 * poses.s),)))

    def inertia(self, psi: np.ndarray) -> tuple[str, np.ndarray, np.ndarray]:
        """See `Operator.inertia`."""
        there, slopes = self._body(psi)
        return self.joint, there, np.vstack([slopes, 0.0 * slopes[:1]])

    def _body(self, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        mass = float(np.exp(psi[0]))
        there, slopes = super()._body(np.array([mass, *psi[1:-1]]))
        slopes[0] *= mass
        return there, slopes

    def starts(self, motions: Motions, gain: Gain) -> tuple[Start, ...]:
        """It is tried as springs are."""
        return (Start(self, self.mean, np.inf),)

    def vanishing(self, psi: np.ndarray) -> np.ndarray:
        """See `Operator.vanishing`."""
        return np.array([-1.0])  # of ln mass

    def of_matter(self, inertia: np.ndarray) -> np.ndarray | None:
        """See `Operator.of_matter`: a base has no other mass of which it could be a share."""
        return None

    def parameters(
        self, values: Mapping[str, tuple[float, float]]
    ) -> dict[str, tuple[float, float, str]]:
        """See `Operator.parameters`."""
        springs = {n: v for n, v in values.items() if " of " in n}
        mass = super().parameters({n: v for n, v in values.items() if n not in springs})
        told = Operator.parameters(self, springs) | mass
        return told | {"height": (*values["height"], "m")}

    def beside(self, psi: np.ndarray) -> tuple[np.ndarray, ...]:
        """See `Operator.beside`: next to nothing, where what moves is stated, and a heavy block."""
        step = self.sd[0] * np.eye(psi.size)[0]
        return psi - 3 * step, psi + step

    def words(self, values: Mapping[str, tuple[float, float]]) -> str:
        """See `Operator.words`."""
        mass, sd, _ = self.parameters(values)["mass"]
        heavy = f" with {with_sd(mass, sd)} kg that it stands on" if mass > KNOWN_SD * sd else ""
        height, sd = values["height"]
        where = "below" if height < 0 else "above"
        tilts = f", tilting about a point {with_sd(abs(height), sd)} m {where} its origin"
        return (
            f"The base gives way{heavy}{tilts if abs(height) > KNOWN_SD * sd else ''} "
            f"({stiffness_told(values)}): check anchor bolts and what the robot stands on."
        )
