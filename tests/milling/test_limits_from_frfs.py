"""Limits by `planner stability` from tap tests' FRFs beside those of the structures' own modes.

`pytest -m slow -s` prints the table; SEED and STRUCTURES say of which structures and how many. None
is drawn again. The limits of the modes are the planner's, and are checked by a method of the tests.
"""

import json
import os
import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from planner.cli.run import run
from tests.support.tap_tests import MOST_M, NOISES, Tap

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
    if tap.method == "full_discretisation":
        rpm, depth = true["spindle_rpm"][0], true["depth"][0]
        if depth < MOST_M:
            assert tap.multiplier(rpm, 0.97 * depth) < 1 < tap.multiplier(rpm, 1.03 * depth)
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
