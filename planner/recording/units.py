"""Units as files state them, to SI; what is not stated is never guessed."""

import re
from typing import NamedTuple


class Unit(NamedTuple):
    """A unit: what it measures, its SI unit, and how many of those it is."""

    quantity: str
    si: str
    factor: float


_LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254,
            "inch": 0.0254, "ft": 0.3048, "mil": 2.54e-5}  # fmt: skip
_FORCES = {"n": 1.0, "newton": 1.0, "kn": 1e3, "mn": 1e-3, "dan": 10.0, "kgf": 9.80665,
           "kp": 9.80665, "gf": 9.80665e-3, "lbf": 4.4482216152605,
           "lb": 4.4482216152605}  # fmt: skip
_TIMES = {"s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "sek": 1.0, "ms": 1e-3, "msec": 1e-3,
          "us": 1e-6}  # fmt: skip
_OTHERS = {
    **{name: Unit("acceleration", "m/s^2", 9.80665) for name in ("g", "gn", "g0")},
    "mg": Unit("acceleration", "m/s^2", 9.80665e-3),
    "gal": Unit("acceleration", "m/s^2", 1e-2),
    "pa": Unit("pressure", "Pa", 1.0),
    **{name: Unit("voltage", "V", 1.0) for name in ("v", "volt", "volts")},
    "mv": Unit("voltage", "V", 1e-3),
    "hz": Unit("frequency", "Hz", 1.0),
    "khz": Unit("frequency", "Hz", 1e3),
    **{name: Unit("angle", "deg", 1.0) for name in ("deg", "degree", "degrees", "°", "grad")},
    **{name: Unit("angle", "deg", 57.29577951308232) for name in ("rad", "radian", "radians")},
}
_PER = ("/s2", "/s/s", "s-2", "/sec2")
_KNOWN: dict[str, Unit] = {
    **{name: Unit("displacement", "m", factor) for name, factor in _LENGTHS.items()},
    **{f"{name}/s": Unit("velocity", "m/s", factor) for name, factor in _LENGTHS.items()},
    **{
        name + per: Unit("acceleration", "m/s^2", f) for name, f in _LENGTHS.items() for per in _PER
    },
    **{name: Unit("force", "N", factor) for name, factor in _FORCES.items()},
    **{name: Unit("time", "s", factor) for name, factor in _TIMES.items()},
    **_OTHERS,
}
MOTIONS = {"acceleration": "accelerance", "velocity": "mobility", "displacement": "receptance"}
_SIGNS = str.maketrans({"²": "2", "µ": "u", "μ": "u", "−": "-", "⁻": "-", "·": "", "*": ""})


def lookup(text: str) -> Unit | None:
    """The unit that is written so ("m/s²", "kN", "[g]"), None if it is not known."""
    plain = re.sub(r"[\s\[\](){}^]", "", text.translate(_SIGNS))
    if re.match(r"M(N|g|V|G)", plain):
        return None  # mega, or milli in capitals: nothing says which
    plain = plain.lower()
    if plain.startswith("voltage"):
        plain = "v"
    return _KNOWN.get(plain)


def lookup_ratio(text: str) -> Unit | None:
    """The unit of an FRF that is written so ("(m/s²)/N", "g/lbf"); None if it is not known.

    `quantity` is then "accelerance", "mobility" or "receptance".
    """
    for at in (i for i, sign in reversed(list(enumerate(text))) if sign == "/"):
        top, bottom = lookup(text[:at]), lookup(text[at + 1 :])
        if top and bottom and top.quantity in MOTIONS and bottom.quantity == "force":
            return Unit(MOTIONS[top.quantity], f"{top.si}/N", top.factor / bottom.factor)
    return None
