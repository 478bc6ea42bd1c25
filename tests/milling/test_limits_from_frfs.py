"""Limits by `planner stability` from tap tests' FRFs beside those of the structures' own modes.

`pytest -m slow -s` prints the table; SEED and STRUCTURES say of which structures and how many. None
is drawn again. The limits of the modes are the planner's, which test_lobes.py checks.
"""

import json
import os
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from planner.cli.run import run
from planner.frf.matrix import FrfMatrix
from planner.recording.dof import Dof
from tests.support.matrix_files import write_matrix

# Cuts that follow each other from structure to structure.
CUT = """
teeth = 3
diameter_m = 0.02
milling = "{}"
radial_immersion = {}
kt_n_m2 = 8.0e8
kr_n_m2 = 2.5e8
spindle_rpm = [4000.0, 12000.0, 4]
depth_m = [0.0, {}, 400]
method = "{}"
"""
MOST_M = 0.05
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
        write_matrix(frfs, FrfMatrix(lines, ends, ends, h, np.full(h.shape, np.nan), True))
        modes.write_text("".join(
            f"[[mode]]\nfrequency_hz = {f!r}\ndamping_ratio = {z!r}\nmass_kg = {m!r}\n"
            f"direction = {d.tolist()}\n"
            for f, z, m, d in zip(self.hertz.tolist(), self.damping.tolist(),
                                  self.mass_kg.tolist(), self.direction, strict=True)
        ))  # fmt: skip
        cut.write_text(CUT.format(*self.immersion, MOST_M, self.method))
        return frfs, modes, cut


SEED, STRUCTURES = int(os.environ.get("SEED", "5200")), int(os.environ.get("STRUCTURES", "100"))
NEAR = 0.05
# What a sentence on lines or noise says: limits are open, or hold but for a mode that is hidden.
OPEN = "Lines or noise of these FRFs do not suffice"
HIDDEN = re.compile(r"Below (\S+) Hz noise and lines of these FRFs would hide a mode")


def limits(source: Path, cut: Path, capsys, *more: str) -> tuple[int, dict, str]:
    """Exit code, answer with limits up to the largest depth asked for, what was said."""
    capsys.readouterr()
    code = run(["stability", str(source), "--cut", str(cut), "--json", *more])
    out = capsys.readouterr()
    if code:
        return code, {}, out.err
    said = json.loads(out.out)
    said["depth"] = np.array([MOST_M if d is None else d for d in said["depth_limit_m"]])
    return code, said, " ".join(said["remarks"])


def outcome(tap: Tap, folder: Path, capsys) -> tuple[str, str, np.ndarray]:
    """How the limits are, what is said of them, and by how much they are off (n,)."""
    frfs, modes, cut = tap.write(folder)
    _, true, _ = limits(modes, cut, capsys)
    code, found, said = limits(frfs, cut, capsys, "--samples", "60")
    if code:
        assert code == 2
        assert "measure" in said
        return "refused", "refused", np.zeros(4)
    off = found["depth"] / true["depth"] - 1
    hidden = HIDDEN.search(said)
    told = "open" if OPEN in said else "hidden" if hidden else "nothing"
    if np.all(np.abs(off) < NEAR):
        return "within 5 %", told, off
    if told == "hidden" and not float(hidden[1]) > tap.hertz.min():
        told = "nothing"  # that no mode lies there is no excuse
    return ("above" if np.max(off) > NEAR else "below"), told, off


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_limits_from_frfs_of_drawn_structures(tmp_path: Path, capsys):
    rows, off = Counter(), []
    for number in range(STRUCTURES):
        tap = Tap.draw(SEED, number)
        folder = tmp_path / str(number)
        folder.mkdir()
        how, told, by = outcome(tap, folder, capsys)
        rows[tap.noise, how, told] += 1
        off.append(np.max(np.abs(by)))
        if how != "within 5 %":
            with capsys.disabled():
                print(
                    number, how, told, (100 * by).round(1), "%; modes", np.sort(tap.hertz).round(1),
                    f"Hz, lines {tap.step_hz:.2f} Hz, noise {100 * tap.noise:g} %, {tap.method}",
                )  # fmt: skip
    columns = [("within 5 %", "nothing"), ("within 5 %", "hidden"), ("within 5 %", "open"),
               ("above", "hidden"), ("above", "open"), ("below", "hidden"), ("below", "open"),
               ("refused", "refused"), ("above", "nothing"), ("below", "nothing")]  # fmt: skip
    with capsys.disabled():
        print(f"seed {SEED}; limits, and what is said of lines and noise")
        print("noise (%) | " + " | ".join(", ".join(column) for column in columns))
        for noise in NOISES:
            print(f"{100 * noise:9g} | " + " | ".join(str(rows[noise, *c]) for c in columns))
        print(f"largest error of each structure: median {100 * np.median(off):.2f} %")
    count = {c: sum(rows[noise, *c] for noise in NOISES) for c in columns}
    assert sum(count.values()) == STRUCTURES
    assert count["above", "nothing"] == 0
    assert count["below", "nothing"] == 0
    near = sum(n for (how, _), n in count.items() if how == "within 5 %")
    assert near >= 0.9 * STRUCTURES
    assert sum(rows[0.0, "within 5 %", told] for told in ("nothing", "hidden")) == sum(
        n for (noise, *_), n in rows.items() if noise == 0
    )
