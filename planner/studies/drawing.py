"""Pictures that the studies share: groups of bars, curves, maps over (frequency, pose)."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

COLOURS = {
    "bias": "0.6", "linear": "tab:olive", "quadratic": "tab:cyan", "cubic": "tab:purple",
    "rbf": "tab:blue", "GP": "tab:blue", "AR1": "tab:green", "NARGP": "tab:orange",
    "averaged RBF": "lightskyblue", "averaged AR1": "limegreen", "AR1-NARGP": "gold",
    "MFDGP": "tab:brown", "simulation": "0.6", "fused modes": "tab:red", "diagnosed": "black",
    "x": "tab:blue", "y": "tab:orange", "z": "tab:green",
    "scatter allows": "0.8", "one by one": "tab:blue", "by kind": "tab:red",
    "all at once": "tab:orange", "groups of three": "tab:green",
    "groups, others known": "limegreen",
}  # fmt: skip


def bars(
    panel: Axes,
    groups: Sequence[str],
    names: Sequence[str],
    values: np.ndarray,
    ylabel: str,
    floor: float | None = None,
) -> None:
    """values (groups, names) side by side; what lies below `floor` is cut, with an arrow there."""
    width = 0.84 / len(names)
    places = np.arange(len(groups))
    for i, name in enumerate(names):
        x = places + (i - (len(names) - 1) / 2) * width
        panel.bar(x, values[:, i], 0.92 * width, label=name, color=COLOURS[name])
        if floor is not None:
            for place in x[values[:, i] < floor]:
                panel.annotate(
                    "", (place, floor), (place, floor + 0.08),
                    arrowprops={"arrowstyle": "-|>", "color": "black", "lw": 0.8},
                )  # fmt: skip
    panel.axhline(0, color="black", lw=0.6)
    if floor is not None:
        panel.set_ylim(floor, 1.05)
    panel.set_xticks(places, groups)
    panel.set_ylabel(ylabel)
    panel.grid(True, axis="y", alpha=0.25)


def band(
    panel: Axes, x: np.ndarray, predicted: np.ndarray, ends: Sequence[np.ndarray],
    label: str = "95 % band",
) -> None:  # fmt: skip
    """A prediction (n,) over x (n,), and its interval's lower and upper ends (n,)."""
    low, high = ends
    panel.fill_between(x, low, high, color="tab:red", alpha=0.25, lw=0, label=label)
    panel.plot(x, predicted, color="tab:red", lw=1.4, label="predicted")
    panel.grid(True, alpha=0.25)


def frf(
    panel: Axes, frequency_hz: np.ndarray, predicted: np.ndarray,
    ends: tuple[np.ndarray, np.ndarray] | np.ndarray, title: str,
) -> None:  # fmt: skip
    """A predicted amplitude (F,) and its 95 % band, lower and upper (F,), in m/s²/N."""
    band(panel, frequency_hz, predicted, (np.maximum(ends[0], 0), ends[1]))
    panel.set_title(title, fontsize=10)
    panel.set_xlim(frequency_hz[0], frequency_hz[-1])
    panel.set_ylim(bottom=0)


def curves(panel: Axes, x: np.ndarray, names: Sequence[str], values: np.ndarray) -> None:
    """values (x, names) as lines with points."""
    for i, name in enumerate(names):
        panel.plot(x, values[:, i], "o-", ms=4, lw=1.4, color=COLOURS[name], label=name)
    panel.grid(True, alpha=0.25)


def maps(
    figure: Figure, panels: Sequence[Axes],
    surfaces: Mapping[str, tuple[np.ndarray, np.ndarray, np.ndarray]], reach_db: float,
) -> None:  # fmt: skip
    """Amplitudes (F, n) in m/s²/N over (n,) and lines (F,) in Hz, one scale as of the first."""
    level = {name: 20 * np.log10(np.maximum(z, 1e-9)) for name, (_, _, z) in surfaces.items()}
    top = next(iter(level.values())).max()
    images = [
        panel.pcolormesh(
            x, y, level[name], vmin=top - reach_db, vmax=top, cmap="viridis", rasterized=True
        )
        for panel, (name, (x, y, _)) in zip(panels, surfaces.items(), strict=True)
    ]
    for panel, name in zip(panels, surfaces, strict=True):
        panel.set_title(name, fontsize=9)
    figure.colorbar(images[-1], ax=list(panels), label="dB re 1 m/s²/N", pad=0.01)
