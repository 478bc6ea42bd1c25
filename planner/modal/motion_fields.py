"""How points move like their neighbours: Gaussian fields over a structure's geometry.

Between neighbours a structure moves smoothly: Matérn fields over the places, and over the trace
lines where there are some (Whittle's field on a graph, as smooth as a bent beam).
"""

import numpy as np

from planner.recording.geometry import Geometry

# Correlation lengths in spacings of the points; ranges of the field on trace lines likewise.
LENGTHS = (1.0, 1.5, 2.2, 3.3, 5.0, 8.0)
NUGGET = 0.03  # of the motion: rows err by this


def motion_fields(nodes: list[str], geometry: Geometry) -> list[np.ndarray]:
    """Covariances (n, n) of motions at the nodes, one on average."""
    place = np.array([geometry.at(node) for node in nodes])
    apart = np.linalg.norm(place[:, None] - place, axis=-1)
    spacing = float(np.median(np.min(apart + np.diag(np.full(len(nodes), np.inf)), axis=1)))
    fields = []
    for length in LENGTHS:
        scaled = np.sqrt(5) * apart / (length * spacing)
        fields.append((1 + scaled + scaled**2 / 3) * np.exp(-scaled))
    ends = {node for line in geometry.lines for node in line}
    if ends.issuperset(nodes):
        fields += _on_lines(nodes, geometry)
    return [field / np.mean(np.diag(field)) for field in fields]


def _on_lines(nodes: list[str], geometry: Geometry) -> list[np.ndarray]:
    """Covariances (n, n) of fields along the trace lines, (κ² + L)⁻² of the graph's Laplacian L."""
    every = list(dict.fromkeys(node for line in geometry.lines for node in line))
    index = {node: k for k, node in enumerate(every)}
    a, b = (np.array([index[line[end]] for line in geometry.lines]) for end in (0, 1))
    place = np.array([geometry.at(node) for node in every])
    length = np.maximum(np.linalg.norm(place[a] - place[b], axis=1), 1e-300)
    weight = (np.median(length) / length) ** 2
    laplacian = np.zeros((len(every), len(every)))
    np.add.at(laplacian, (a, b), -weight)
    np.add.at(laplacian, (b, a), -weight)
    laplacian -= np.diag(np.sum(laplacian, axis=1))
    chosen = [index[node] for node in nodes]
    values, vectors = np.linalg.eigh(laplacian)
    fields = []
    for reach in LENGTHS:
        power = 1 / (1 / reach**2 + np.maximum(values, 0.0)) ** 2
        fields.append((vectors[chosen] * power) @ vectors[chosen].T)
    return fields
