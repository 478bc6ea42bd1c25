"""Limits by `planner stability` from tap tests' FRFs beside those of the structures' own modes.

None is drawn again; `pytest -m slow` takes a hundred. The limits of the modes are the planner's,
which test_lobes.py checks.
"""

import json
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from planner.frf.matrix import FrfMatrix
from planner.recording.points import Dof
from tests.support.matrix_files import write_matrix
from tests.support.milling_cases import cut_toml, modes_toml
from tests.support.outside import call

MOST_M = 0.05
CUT = {
    "teeth": 3, "kt_n_m2": 8e8, "kr_n_m2": 2.5e8, "spindle_rpm": (4000.0, 12000.0, 4),
    "depth_m": (0.0, MOST_M, 400),
}  # fmt: skip
# Cuts that follow each other from structure to structure.
IMMERSIONS = (("down", 0.3), ("up", 0.6), ("slot", 1.0))
METHODS = ("zeroth_order", "full_discretisation")
NOISES = (0.0, 0.001, 0.003, 0.01)  # of the largest accelerance, on every line alike


@dataclass(frozen=True, eq=False)
class Tap:
    """A structure of 1 to 4 modes (m,), directions (m, 3), and how it is tapped and cut."""

    hertz: np.ndarray
    damping: np.ndarray
    mass_kg: np.ndarray
    direction: np.ndarray
    step_hz: float
    noise: float
    immersion: tuple[str, float]
    method: str
    seed: int

    @classmethod
    def draw(cls, seed: int, number: int) -> "Tap":
        """8 to 1500 Hz, 1 to 5 % damping, lines 0.1 to 2 Hz apart; each third has close modes."""
        rng = np.random.default_rng([seed, number])
        count = int(rng.integers(1, 5))
        hertz = np.exp(rng.uniform(np.log(8), np.log(1500), count))
        if count > 1 and rng.random() < 1 / 3:
            hertz[1] = hertz[0] * (1 + rng.uniform(0.005, 0.05))
        stiffness = np.exp(rng.uniform(np.log(2e6), np.log(4e7), count))
        direction = rng.standard_normal((count, 3))
        return cls(
            hertz, rng.uniform(0.01, 0.05, count), stiffness / (2 * np.pi * hertz) ** 2,
            direction / np.linalg.norm(direction, axis=1)[:, None],
            float(np.exp(rng.uniform(np.log(0.1), np.log(2.0)))), float(rng.choice(NOISES)),
            IMMERSIONS[number % 3], METHODS[number % 2], seed + number,
        )  # fmt: skip

    @property
    def lines(self) -> np.ndarray:
        """(F,) to beyond the highest mode."""
        top = max(1.3 * self.hertz.max() + 20 * self.step_hz, 40 * self.step_hz)
        return self.step_hz * np.arange(1, int(top / self.step_hz) + 1)

    def accelerance(self, lines: np.ndarray) -> np.ndarray:
        """(2, 2, F) in m/s²/N along x and y."""
        omega, own = 2 * np.pi * lines, 2 * np.pi * self.hertz[:, None]
        d = self.direction[:, :2]
        stiff = own**2 - omega**2 + 2j * self.damping[:, None] * own * omega
        return np.einsum("ki,kj,kf->ijf", d, d, -(omega**2) / self.mass_kg[:, None] / stiff)

    def write(self, folder: Path) -> tuple[Path, Path, Path]:
        """FRFs as UFF 58 with noise, the modes as TOML, cut.toml."""
        lines, rng = self.lines, np.random.default_rng(self.seed)
        h = self.accelerance(lines)
        parts = rng.standard_normal((2, *h.shape)) / np.sqrt(2)
        h = h + self.noise * np.abs(h).max() * (parts[0] + 1j * parts[1])
        frfs, modes, cut = folder / "tap.uff", folder / "modes.toml", folder / "cut.toml"
        ends = Dof("1", "x"), Dof("1", "y")
        write_matrix(frfs, FrfMatrix(lines, ends, ends, h, True))
        own = self.hertz, self.damping, self.mass_kg, self.direction
        modes.write_text(modes_toml(*(values.tolist() for values in own)))
        milling, share = self.immersion
        cut.write_text(cut_toml(**CUT, milling=milling, radial_immersion=share, method=self.method))
        return frfs, modes, cut


SEED = 5200
NEAR = 0.05
# What a sentence on lines or noise says: limits are open, or hold but for a mode that is hidden.
OPEN = "Lines or noise of these FRFs do not suffice"
HIDDEN = re.compile(r"Below (\S+) Hz noise and lines of these FRFs would hide a mode")


def limits(source: Path, cut: Path, *more: object) -> tuple[int, np.ndarray, str]:
    """Exit code, limits up to the largest depth asked for, and what was said."""
    code, out, err = call("stability", source, "--cut", cut, "--json", *more)
    if code:
        return code, np.zeros(4), err
    said = json.loads(out)
    depth = np.array([MOST_M if d is None else d for d in said["depth_limit_m"]])
    return code, depth, " ".join(said["remarks"])


def outcome(tap: Tap, folder: Path) -> tuple[str, str]:
    """How the limits are, and what is said of them."""
    frfs, modes, cut = tap.write(folder)
    _, true, _ = limits(modes, cut)
    code, found, said = limits(frfs, cut, "--samples", 60)
    if code:
        assert code == 2
        assert "measure" in said
        return "refused", "refused"
    off = found / true - 1
    hidden = HIDDEN.search(said)
    told = "open" if OPEN in said else "hidden" if hidden else "nothing"
    if np.all(np.abs(off) < NEAR):
        return "near", told
    if told == "hidden" and not float(hidden[1]) > tap.hertz.min():
        told = "nothing"  # that no mode lies there is no excuse
    return "off", told


@pytest.mark.parametrize(
    "count", [6, pytest.param(100, marks=[pytest.mark.slow, pytest.mark.timeout(3600)])]
)
def test_limits_from_frfs_of_drawn_structures(tmp_path: Path, count: int):
    rows = Counter()
    for number in range(count):
        tap = Tap.draw(SEED, number)
        (tmp_path / str(number)).mkdir()
        rows[tap.noise > 0, *outcome(tap, tmp_path / str(number))] += 1
    print(rows)
    assert not [row for row in rows if row[1:] == ("off", "nothing")]
    near = sum(n for (_, how, _), n in rows.items() if how == "near")
    assert near >= (0.9 if count == 100 else 0.7) * count  # of few structures the share scatters
    assert {row[1:] for row in rows if not row[0]} <= {("near", "nothing"), ("near", "hidden")}
