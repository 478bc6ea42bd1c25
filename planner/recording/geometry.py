"""Where the points of a test lie: nodes and trace lines of universal files."""

from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from planner.recording.uff import opened

# Datasets: nodes (15 and 2411), trace lines (82), units (164).
NODES, TRACES, UNITS = (15, 2411), 82, 164
SUFFIXES = (".uff", ".unv", ".uf58", ".txt")


@dataclass(frozen=True, eq=False)
class Geometry:
    """Points by name and what joins them: position_m (n, 3), lines as pairs of names."""

    nodes: tuple[str, ...]
    position_m: np.ndarray
    lines: tuple[tuple[str, str], ...] = ()

    def at(self, node: str) -> np.ndarray | None:
        """Position (3,) of a node, None where it is not known."""
        return self.position_m[self.nodes.index(node)] if node in self.nodes else None


def read_geometry(paths: tuple[Path, ...]) -> Geometry | None:
    """Nodes and trace lines that universal files hold, the later ones first; None without nodes.

    Lengths are in m where a file states its units (dataset 164), else as they stand.
    """
    position: dict[str, np.ndarray] = {}
    lines: list[tuple[str, str]] = []
    for path in paths:
        if path.suffix.lower() in SUFFIXES:
            found: list[Any] = []  # what cannot be read is left out: it is no measurement
            with opened(path) as (file, kinds):
                for index, kind in enumerate(kinds):
                    if kind in (*NODES, TRACES, UNITS):
                        with suppress(Exception):
                            found.append(file.read_sets(index))
            factors = [float(s.get("length", 1.0)) for s in found if s["type"] == UNITS]
            # A dataset 164 states how many of the file's lengths make a metre.
            scale = 1 / factors[-1] if factors and factors[-1] > 0 else 1.0
            for s in found:
                if s["type"] in NODES:
                    places = scale * np.stack([np.asarray(s[axis], float) for axis in "xyz"], 1)
                    names = (str(int(number)) for number in s["node_nums"])
                    position |= dict(zip(names, places, strict=True))
                elif s["type"] == TRACES:
                    pairs = pairwise(int(n) for n in s["nodes"])  # 0 lifts the pen
                    lines += [(str(a), str(b)) for a, b in pairs if a and b and a != b]
    if not position:
        return None
    known = tuple(dict.fromkeys(line for line in lines if set(line) <= set(position)))
    return Geometry(tuple(position), np.array(list(position.values())), known)
