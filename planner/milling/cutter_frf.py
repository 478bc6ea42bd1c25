"""FRFs at the cutter: read from files, seen in the plane of a cut."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.errors import InputError
from planner.frf.matrix import labelled_frfs
from planner.frf.synthesis import convert
from planner.milling.cut import Cut
from planner.recording.read import read_frfs
from planner.recording.records import AXES

SEEN = 1e-9  # share of a direction in the plane of the cut that does not count
LEAST_LINES = 16
BESIDE = (
    "These FRFs are of the sensor, which is not at the tcp, and are taken for the tip's: name the "
    "campaign itself for those of the tip."
)


@dataclass(frozen=True, eq=False)
class CutterFrf:
    """Receptance (d, d, F) in m/N at lines (F,) above 0 Hz: response axis, then force axis.

    d is 3 in the axes of the FRFs (NaN where not known), 2 in the plane of a cut. `sd` (d, d, F) is
    the root of E|H − mean|², None if unknown; `name` says of what; `joints_rad` (dof,) where the
    source says how the robot stood.
    """

    name: str
    frequency_hz: np.ndarray
    receptance: np.ndarray
    sd: np.ndarray | None = None
    simulated: bool = False
    remarks: tuple[str, ...] = ()
    joints_rad: np.ndarray | None = None

    def in_plane(self, cut: Cut) -> "CutterFrf":
        """In the plane of the cut; InputError where an axis that this needs is not known.

        Cross FRFs that lack are those of the other way round, else 0, as a tap test has it.
        """
        used = np.any(np.abs(cut.plane) > SEEN, axis=0)
        whole, remarks = self._with_cross(used)
        h = _turned(whole, cut.plane)
        if not np.all(np.isfinite(h)):
            missing = [AXES[i] for i in np.flatnonzero(used & ~self._known.diagonal())]
            raise InputError(
                f"{self.name} lacks FRFs along {', '.join(missing)}, which the cut's plane needs; "
                f"measure them, or check feed and axis in the cut's file."
            )
        sd = None
        if self.sd is not None:
            # Errors of different entries are taken as independent of each other.
            square = _turned(np.nan_to_num(self.sd) ** 2, cut.plane**2)
            sd = np.sqrt(square.real)
        return replace(self, receptance=h, sd=sd, remarks=remarks)

    @property
    def allowance(self) -> np.ndarray | None:
        """(d, d, F) in (m/s²/N)²: how far off a fit may be, squared; None where no sd is stated.

        A tenth of the sd adds nothing to it; the mean of uncertain FRFs is that of no modes: more
        poles would follow it and mean nothing. A share of the matrix keeps what has no sd from
        being trusted without limit.
        """
        if self.sd is None:
            return None
        size = np.linalg.norm(self.receptance, axis=(0, 1))
        return np.hypot(0.1 * self.sd, 1e-4 * size) ** 2 * (2 * np.pi * self.frequency_hz) ** 4

    @property
    def _known(self) -> np.ndarray:
        """(3, 3) which entries are known."""
        return np.all(np.isfinite(self.receptance), axis=-1)

    def _with_cross(self, used: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
        """FRFs between axes in use (3,) that have one each, where these lack, and what they are."""
        h, known, said = self.receptance.copy(), self._known, [*self.remarks]
        there = used & known.diagonal()
        for i, j in np.argwhere(np.outer(there, there) & ~known):
            h[i, j] = self.receptance[j, i] if known[j, i] else 0.0
            other = f"as {AXES[j]}{AXES[i]}" if known[j, i] else "as 0"
            said.append(f"{self.name} lacks the FRF {AXES[i]}{AXES[j]}: it is taken {other}.")
        return h, tuple(said)


def _turned(values: np.ndarray, plane: np.ndarray) -> np.ndarray:
    """(2, 2, F) of (3, 3, F); entries that the plane does not see may be NaN."""
    weight = np.where(np.abs(plane) > SEEN, plane, 0.0)
    share = np.einsum("ia,jb->ijab", weight, weight)
    parts = np.where(share[..., None] == 0, 0.0, share[..., None] * values)
    return parts.sum(axis=(2, 3))


def read_frf(path: Path, pose: str | None, from_names: bool = False) -> CutterFrf:
    """An npz of `predict` or `couple`, or exported FRFs, in a file or a folder of files.

    `from_names` as in `read_frfs`. Raises InputError in one sentence.
    """
    if not path.exists():
        raise InputError(f"{path} does not exist; name FRFs, modes or a campaign.")
    if path.suffix.lower() == ".npz":
        names, held = read_npz(path)
        row, sd = row_of(path, names, pose), held.get("frf_sd")
        name, spread = f"{path}, pose {names[row]}", None if sd is None else sd[row]
        found = of_accelerance(name, held["frequency_hz"], held["frf_mean"][row], spread)
        return found if held.get("sensor_at_tcp", True) else replace(found, remarks=(BESIDE,))
    if pose is not None:
        raise InputError(f"{path} holds FRFs of one pose only; leave --pose out.")
    frequency, frfs = labelled_frfs(read_frfs(path, from_names), "accelerance", InputError)
    h = np.full((3, 3, len(frequency)), np.nan + 0j)
    for (_, i), (_, j), values, _ in frfs:
        h[i, j] = values
    return of_accelerance(str(path), frequency, h, None)


def of_accelerance(
    name: str, frequency_hz: np.ndarray, mean: np.ndarray, sd: np.ndarray | None
) -> CutterFrf:
    """From an accelerance (3, 3, F) in m/s²/N."""
    keep = frequency_hz > 0
    hertz = frequency_hz[keep]
    if np.count_nonzero(keep) < LEAST_LINES or np.any(np.diff(hertz) <= 0):
        raise InputError(
            f"{name} has {np.count_nonzero(keep)} lines above 0 Hz; give {LEAST_LINES} or more, "
            f"in rising order."
        )
    h = convert(hertz, mean[..., keep], "accelerance", "receptance")
    spread = None if sd is None else sd[..., keep] / (2 * np.pi * hertz) ** 2
    return CutterFrf(name, hertz, h, spread)


def names_in(path: Path) -> list[str | None]:
    """Every pose of an npz of `predict`, in its order; of other files None, the one they hold."""
    return list(read_npz(path)[0]) if path.suffix.lower() == ".npz" else [None]


def read_npz(path: Path) -> tuple[list[str], dict[str, np.ndarray]]:
    """Names of the poses and all arrays of an npz; InputError where they do not fit together."""
    try:
        with np.load(path, allow_pickle=False) as file:
            held = {name: file[name] for name in file.files}
    except FileNotFoundError:
        raise InputError(f"{path} does not exist; name an npz of predict.") from None
    except Exception:  # zip, pickle and array faults of a broken file
        raise InputError(
            f"{path} cannot be read as an npz; write it with planner predict."
        ) from None
    lacking = [name for name in ("frequency_hz", "frf_mean") if name not in held]
    if lacking:
        raise InputError(f"{path} holds no {lacking[0]}; write it with planner predict --out.")
    hertz = held["frequency_hz"] = np.asarray(held["frequency_hz"], float)
    if hertz.ndim != 1 or len(hertz) < 2 or not np.all(np.diff(hertz) > 0):
        raise InputError(f"{path}: frequency_hz does not increase; write it with predict --out.")
    names = [str(name) for name in np.atleast_1d(held.get("pose", np.array(["1"])))]
    for name, size in (("frf_mean", 3), ("frf_sd", 3), ("frf6_mean", 6), ("frf6_sd", 6)):
        shape = (len(names), size, size, len(hertz))
        if name in held and held[name].shape != shape:
            raise InputError(
                f"{path}: {name} has the shape {held[name].shape} instead of (poses, {size}, "
                f"{size}, lines) = {shape}; write it with planner predict."
            )
    return names, held


def row_of(path: Path, names: list[str], pose: str | None) -> int:
    """Number of a pose in an npz; InputError where it is not there, or several are."""
    few = ", ".join(names[:5]) + (", …" if len(names) > 5 else "")
    if pose is None and len(names) > 1:
        raise InputError(f"{path} holds {len(names)} poses; say which of {few} with --pose.")
    if pose is not None and pose not in names:
        raise InputError(f"{path} has no pose {pose}; choose one of {few}.")
    return 0 if pose is None else names.index(pose)
