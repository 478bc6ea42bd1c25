"""Units as files state them, to SI; what is not stated is never guessed."""

import re

# unit as written (lower case, without blanks, ^, *, ·) -> (quantity, SI unit, factor)
_KNOWN: dict[str, tuple[str, str, float]] = {
    "n": ("force", "N", 1.0),
    "newton": ("force", "N", 1.0),
    "kn": ("force", "N", 1e3),
    "mn": ("force", "N", 1e-3),
    "lbf": ("force", "N", 4.4482216152605),
    "m/s2": ("acceleration", "m/s^2", 1.0),
    "m/s/s": ("acceleration", "m/s^2", 1.0),
    "ms-2": ("acceleration", "m/s^2", 1.0),
    "cm/s2": ("acceleration", "m/s^2", 1e-2),
    "mm/s2": ("acceleration", "m/s^2", 1e-3),
    "gal": ("acceleration", "m/s^2", 1e-2),
    "g": ("acceleration", "m/s^2", 9.80665),
    "gn": ("acceleration", "m/s^2", 9.80665),
    "m/s": ("velocity", "m/s", 1.0),
    "mm/s": ("velocity", "m/s", 1e-3),
    "m": ("displacement", "m", 1.0),
    "mm": ("displacement", "m", 1e-3),
    "um": ("displacement", "m", 1e-6),
    "pa": ("pressure", "Pa", 1.0),
    "v": ("voltage", "V", 1.0),
    "volt": ("voltage", "V", 1.0),
    "mv": ("voltage", "V", 1e-3),
    "s": ("time", "s", 1.0),
    "sec": ("time", "s", 1.0),
    "seconds": ("time", "s", 1.0),
    "ms": ("time", "s", 1e-3),
    "hz": ("frequency", "Hz", 1.0),
    "khz": ("frequency", "Hz", 1e3),
}


def lookup(text: str) -> tuple[str, str, float] | None:
    """(quantity, SI unit, factor) of a unit as written, None if it is not known."""
    plain = text.strip().lower().replace("²", "2").replace("µ", "u").replace("μ", "u")
    plain = re.sub(r"[\s^*·\[\]()]", "", plain)
    if plain.startswith("voltage"):
        plain = "v"
    return _KNOWN.get(plain)
