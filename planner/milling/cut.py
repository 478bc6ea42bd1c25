"""cut.toml: which cut is asked about, as a typed table; its feed at poses of a robot."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np

from planner.errors import InputError
from planner.toml_file import limited, load_toml

Percent = Annotated[float, limited(ge=0, le=100)]

MOST_TEETH = 64
MOST_POINTS = 20_000  # of speeds, or of depths
UNIT = 1e-3  # by how much the length of a stated direction may differ from one, or be oblique
SLOT = 1.0  # radial immersion of a slot


class Cut(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A cutter, its immersion, the cutting coefficients, and which speeds and depths are asked for.

    `axis` is the tool's direction from its tip to the spindle in the frame of the FRFs, as
    `to_spindle` in tool.toml; the spindle turns clockwise seen from behind it. `feed` is the tool's
    direction over the workpiece, in the same frame, or with `feed_in = "base"` in that of the
    robot's base; with "path" it follows the path's own positions.
    `kt_n_m2` and `kr_n_m2` are the tangential and radial force per area of the chip's section,
    `kr_n_m2` positive where it pushes the cutter away. `pitch_deg` are the angles from each tooth
    to the one ahead of it (none: all alike), `helix_deg` how far the teeth are wound.
    `kt_sd_percent` and `kr_sd_percent` say how well the coefficients are known.
    """

    teeth: Annotated[int, limited(ge=1, le=MOST_TEETH)]
    diameter_m: Annotated[float, limited(ge=1e-5, le=1)]
    milling: Literal["slot", "down", "up"]
    kt_n_m2: Annotated[float, limited(ge=1e5, le=1e12)]
    kr_n_m2: Annotated[float, limited(ge=-1e12, le=1e12)]
    spindle_rpm: tuple[float, float, int]
    depth_m: tuple[float, float, int]
    radial_immersion: Annotated[float, limited(ge=1e-4, le=1)] = SLOT
    feed: tuple[float, float, float] = (1.0, 0.0, 0.0)
    feed_in: Literal["frf", "base", "path"] = "frf"
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    method: Literal["full_discretisation", "semi_discretisation", "zeroth_order"] = (
        "full_discretisation"
    )
    pitch_deg: list[float] | None = None
    helix_deg: Annotated[float, limited(ge=0, le=80)] = 0.0
    kt_sd_percent: Percent = 0.0
    kr_sd_percent: Percent = 0.0

    @property
    def speeds_rpm(self) -> np.ndarray:
        """(n,) spindle speeds that are asked for."""
        low, high, count = self.spindle_rpm
        return np.linspace(low, high, count)

    def at_speed(self, rpm: float) -> "Cut":
        """The same at one speed."""
        return msgspec.structs.replace(self, spindle_rpm=(rpm, rpm, 1))

    @property
    def plane(self) -> np.ndarray:
        """(2, 3) unit vectors of the cut in the frame of the FRFs: feed, and axis × feed."""
        feed, axis = _unit(self.feed), _unit(self.axis)
        return np.array([feed, np.cross(axis, feed)])

    @property
    def immersion_rad(self) -> tuple[float, float]:
        """Angles of the teeth, from the normal towards the feed, at which they enter and leave."""
        if self.milling == "slot":
            return 0.0, float(np.pi)
        swept = float(np.arccos(1 - 2 * self.radial_immersion))
        return (0.0, swept) if self.milling == "up" else (float(np.pi) - swept, float(np.pi))

    @property
    def pitches_rad(self) -> np.ndarray:
        """(teeth,) angles from each tooth to the one ahead of it, which cuts before."""
        if self.pitch_deg is None:
            return np.full(self.teeth, 2 * np.pi / self.teeth)
        return np.deg2rad(self.pitch_deg)

    @property
    def even(self) -> bool:
        """Whether all teeth follow at the same angle."""
        return bool(np.ptp(self.pitches_rad) < 1e-9)

    @property
    def lag_rad_m(self) -> float:
        """By how much a tooth lags behind its tip, in rad per metre of depth."""
        return 2 * float(np.tan(np.deg2rad(self.helix_deg))) / self.diameter_m


def load_cut(path: Path) -> Cut:
    """Read and check cut.toml; InputError with one sentence where it is wrong."""
    cut = load_toml(path, Cut, "cut.toml")
    _check(cut, path)
    return cut


def _unit(direction: tuple[float, float, float]) -> np.ndarray:
    found = np.array(direction, dtype=float)
    return found / np.linalg.norm(found)


def _check(cut: Cut, path: Path) -> None:
    _check_range(cut.spindle_rpm, 1.0, 1e6, f"{path}: spindle_rpm")
    _check_range(cut.depth_m, 0.0, 1.0, f"{path}: depth_m")
    if cut.depth_m[1] <= 0:
        raise InputError(f"{path}: depth_m ends at 0; let it end at a depth above 0 m.")
    if cut.milling == "slot" and cut.radial_immersion != SLOT:
        raise InputError(
            f"{path}: milling is a slot and radial_immersion {cut.radial_immersion:g}; leave it "
            f'out, or say "up" or "down".'
        )
    check_unit(str(path), feed=cut.feed, axis=cut.axis)
    if cut.feed_in == "frf" and abs(float(np.dot(cut.feed, cut.axis))) > UNIT:
        raise InputError(f"{path}: feed is not at right angles to the axis; correct one of them.")
    if cut.pitch_deg is not None and (
        len(cut.pitch_deg) != cut.teeth
        or min(cut.pitch_deg) <= 0
        or abs(sum(cut.pitch_deg) - 360) > 1e-6
    ):
        raise InputError(
            f"{path}: pitch_deg needs {cut.teeth} angles above 0 that sum to 360; correct it."
        )


def check_unit(where: str, **vectors: tuple[float, float, float]) -> None:
    """InputError for the first that is no unit vector."""
    for name, given in vectors.items():
        if not abs(np.linalg.norm(given) - 1) < UNIT:
            raise InputError(f"{where}: {name} is not of length 1; give a unit vector.")


def _check_range(given: tuple[float, float, int], least: float, most: float, name: str) -> None:
    low, high, count = given
    if not least <= low <= high <= most:
        raise InputError(
            f"{name} goes from {low:g} to {high:g}; it must rise between {least:g} and {most:g}."
        )
    if not 1 <= count <= MOST_POINTS or (count == 1 and low != high):
        raise InputError(
            f"{name} asks for {count} values; give 2 to {MOST_POINTS}, or 1 if both ends agree."
        )


def cuts_at(
    cut: Cut, rotation: np.ndarray, position_m: np.ndarray, names: Sequence[str]
) -> list[Cut]:
    """The cut at each of p poses, its feed in the axes of the FRFs there.

    rotation (p, 3, 3) of the tcp in the base frame, position_m (p, 3) of the path in order, which
    gives the feed where `feed_in` is "path". InputError where a feed is along the tool's axis.
    """
    if cut.feed_in == "frf":
        return [cut] * len(rotation)
    feeds = np.tile(np.array(cut.feed, float), (len(rotation), 1))
    if cut.feed_in == "path":
        feeds = _tangents(position_m)
    return [
        turned_to(cut, turn, feed, name)
        for turn, feed, name in zip(rotation, feeds, names, strict=True)
    ]


def turned_to(cut: Cut, rotation: np.ndarray, feed: np.ndarray, name: str) -> Cut:
    """The cut with a feed (3,) in the base frame, at a rotation (3, 3) of the tcp there.

    What counts of the feed is its part across the tool's axis.
    """
    axis = np.array(cut.axis) / np.linalg.norm(cut.axis)
    own = rotation.T @ (feed / max(float(np.linalg.norm(feed)), 1e-300))
    across = own - axis * (axis @ own)
    size = float(np.linalg.norm(across))
    # Least share of a feed's length across the tool's axis: with less it is a plunge
    if not size > 0.2:
        raise InputError(
            f"{name}: the feed is along the tool's axis, or there is none; check feed, feed_in and "
            f"axis in the cut's file, and the path."
        )
    x, y, z = (float(v) for v in across / size)
    return msgspec.structs.replace(cut, feed=(x, y, z), feed_in="frf")


def no_pose(cut: Cut, source: object) -> None:
    """InputError where the cut's feed asks for a pose that a source does not know."""
    if cut.feed_in != "frf":
        raise InputError(
            f"{source} does not say how the robot stands, which feed_in = {cut.feed_in!r} in the "
            f"cut's file needs; name a campaign, or state the feed in the axes of the FRFs (frf)."
        )


def _tangents(position_m: np.ndarray) -> np.ndarray:
    """(p, 3) from each pose's neighbour to the next."""
    if len(position_m) < 2:
        raise InputError(
            'A path of one pose has no direction, which feed_in = "path" in the cut\'s file needs; '
            "give more poses, or state the feed."
        )
    return np.gradient(position_m, axis=0)
