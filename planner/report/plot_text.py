"""Text in pictures: the user's own, and values in coloured cells."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage

# Relative luminance of sRGB (ITU-R BT.709), and the one at which black and white contrast alike
# with a colour (WCAG 2: (L + 0.05)² = 0.05 · 1.05).
WEIGHTS, ALIKE = (0.2126, 0.7152, 0.0722), 0.179


def plain_text(text: str) -> str:
    """A name as it stands: Matplotlib would read what lies between two dollars as a formula."""
    return text.replace("$", r"\$")


def ink(colour: ArrayLike) -> str:
    """ "black" or "white", whichever is read better on a colour (3 or 4 numbers, 0 to 1)."""
    part = np.asarray(colour, dtype=float)[:3]
    linear = np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)
    return "black" if linear @ WEIGHTS > ALIKE else "white"


def write_values(panel: "Axes", image: "AxesImage", form: str, **style: Any) -> None:
    """Values of an image (`form` as of `format`) in its cells, in readable ink."""
    values = np.asarray(image.get_array(), dtype=float)
    for (i, j), value in np.ndenumerate(values):
        if np.isfinite(value):
            colour = ink(image.to_rgba(value))
            panel.text(j, i, format(value, form), ha="center", va="center", color=colour, **style)
