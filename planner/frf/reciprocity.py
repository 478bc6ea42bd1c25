"""Maxwell's reciprocity at the tool: hitting along x and feeling along y is as good as y and x."""

import numpy as np

from planner.frf.frf import Frf
from planner.recording.records import AXES

# Of ‖H_ij − H_ji‖ over √(‖H_ii‖ ‖H_jj‖). Good poses have 0.05 to 0.35 where hits tilt by 2° and the
# sensor sits at the tcp, and up to 0.75 where it sits beside it; a turned sign has up to 2, an
# exchanged axis 1 and more. Chosen between.
NOT_RECIPROCAL = 0.9


def unreciprocal(frf: Frf) -> tuple[str, ...]:
    """Remarks on pairs of axes of a tool's FRF (3, 3, F) that do not fit each other."""
    found = []
    h = frf.accelerance
    for i, j in ((0, 1), (0, 2), (1, 2)):
        entries = h[i, j], h[j, i], h[i, i], h[j, j]
        if not all(np.all(np.isfinite(entry)) for entry in entries):
            continue
        size = np.sqrt(np.linalg.norm(h[i, i]) * np.linalg.norm(h[j, j]))
        apart = float(np.linalg.norm(h[i, j] - h[j, i]) / max(size, 1e-300))
        if apart > NOT_RECIPROCAL:
            found.append(
                f"Hits along {AXES[i]} felt along {AXES[j]} and hits along {AXES[j]} felt along "
                f"{AXES[i]} differ by {100 * apart:.0f} % of what is felt along the hits: they "
                f"should be alike; check axes and signs of hits and sensor."
            )
    return tuple(found)
