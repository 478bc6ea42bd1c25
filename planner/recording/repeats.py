"""Hits of a pose beside each other: whether repeats along an axis agree, in shape and in size."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.recording.force_levels import level_of, levels
from planner.recording.records import AXES, Fault, Hit
from planner.recording.sampling import same_rate
from planner.recording.screening import SILENCE, band_spectra

# Likeness of repeats: of two, below the first they are unlike; of more, by so much below what is
# usual (of 2,430 hits that were 3° and 5 mm off at most none was by 0.1); above the last the same.
UNLIKE, FAR_BELOW, LIKE = 0.5, 0.2, 0.8
MOST_TILT = 0.1  # rad: three times what a hand usually tilts by
SAME = 0.95  # from which, in size too, two hits are of one axis: as like as hits of one pose are
OTHER_SIZE = np.log(2.0)  # ln of sizes of repeats: hands and levels differ by some 30 %. Chosen.
WHOLE = 0.5  # share of another axis' FRF that is no tilt: that axis was hit


def screen_repeats(
    hits: tuple[Hit, ...], band_hz: tuple[float, float]
) -> tuple[tuple[Fault, ...], ...]:
    """Per hit, whether its FRF disagrees with its axis' others (wrong axis, size, incoherent).

    Only hits at one point that the same sensors heard, sampled alike, are compared, and where three
    or more were made along an axis; a robust vote needs a majority. What a careful hand misses by
    is no disagreement, and what only sets one force level apart from another may be the structure:
    that is for the diagnosis to say.
    """
    faults: list[tuple[Fault, ...]] = [() for _ in hits]
    for own, alike in _groups(hits, band_hz):
        for axis in alike.centres:
            for i, fault in alike.faults(axis):
                faults[own[i]] = (fault,)
    return tuple(faults)


@dataclass(frozen=True)
class Doubt:
    """Why one of a few hits is wrong, and nothing tells which: no way has most of an axis' hits.

    `others` are the hits it contradicts, by their places among all; with `along` they are of
    that other axis and answer as it does, which hits of two axes do not. With a `size`, the ln of
    how much larger it is, it differs from them in that alone.
    """

    others: tuple[int, ...]
    likeness: float
    along: str = ""
    size: float = 0.0


def doubts(hits: tuple[Hit, ...], band_hz: tuple[float, float]) -> tuple[Doubt | None, ...]:
    """Per hit, whether it contradicts half of those of its axis, or repeats another axis'.

    Of two hits that disagree the one that answers as another axis does is doubted alone. More may
    differ in size, and no majority tells which is right.
    """
    found: list[Doubt | None] = [None] * len(hits)
    for own, alike in _groups(hits, band_hz):
        for i, place in enumerate(own):
            if doubt := alike.doubt(i):
                found[place] = replace(doubt, others=tuple(own[j] for j in doubt.others))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class _Alike:
    """FRFs (n, N) of hits that can be compared, with the axis and force level (n,) of each."""

    frfs: np.ndarray
    axes: np.ndarray
    level: np.ndarray

    @classmethod
    def of(cls, hits: Sequence[Hit], band_hz: tuple[float, float]) -> "_Alike":
        peaks = np.array([hit.pulse.peak_n for hit in hits])
        level = level_of(peaks, levels(np.sort(peaks)))
        return cls(_frfs(hits, band_hz), np.array([hit.axis_index for hit in hits]), level)

    @cached_property
    def centres(self) -> dict[int, np.ndarray]:
        """The usual FRF along each axis."""
        return {axis: _centre(self.frfs[self.axes == axis]) for axis in set(self.axes.tolist())}

    def faults(self, axis: int) -> Iterator[tuple[int, Fault]]:
        """Hits that disagree with three or more along an axis, and how."""
        group, own = np.flatnonzero(self.axes == axis), self._agreement(axis, self.centres[axis])
        if len(group) < 3:
            return
        alike = np.array([own.of(frf) for frf in self.frfs[group]])
        typical, sizes = float(np.median(alike)), own.sizes(self.frfs[group])
        for i, share, size in zip(group.tolist(), alike, sizes, strict=True):
            if size and outvoted(sizes):
                text = f"It {other_size(size, 'its repeats')} Correct the file, or hit again."
                yield i, Fault("other_size", text)
                continue
            if share > typical - FAR_BELOW and not own.struck(self.frfs[i]):
                continue
            same = [self.frfs[j] for j in group if j != i and self.level[j] == self.level[i]]
            if told := own.disagreement(self.frfs[i], same):
                text = f"Its FRF {told[1]} (correlation {share:.2f}, others {typical:.2f})"
                yield i, Fault(told[0], f"{text}; check axis and hit point, and hit again.")

    def doubt(self, i: int) -> Doubt | None:
        same = [int(j) for j in np.flatnonzero(self.axes == self.axes[i]) if j != i]
        if not same:
            return self._repeated(i)
        sized = self._sized(i, same)
        if sized:
            return sized
        against = [doubt for j in same if (doubt := self._contradicted(i, j))]
        if 2 * len(against) <= len(same):  # most answer as it does
            return None
        others = tuple(j for doubt in against for j in doubt.others)
        return Doubt(others, max(doubt.likeness for doubt in against))

    def _sized(self, i: int, same: list[int]) -> Doubt | None:
        own = self.frfs[[i, *same]]
        agreement = self._agreement(self.axes[i], _centre(own))
        sizes = agreement.sizes(own)
        if not sizes[0] or outvoted(sizes):
            return None
        other = tuple(j for j, size in zip(same, sizes[1:], strict=True) if size * sizes[0] <= 0)
        return Doubt(other, agreement.of(own[0]), size=float(sizes[0]))

    def _agreement(self, axis: int, centre: np.ndarray) -> "_Agreement":
        across = {other: frf for other, frf in self.centres.items() if other != axis}
        return _Agreement(centre, across)

    def _contradicted(self, i: int, j: int) -> Doubt | None:
        both = self.frfs[i], self.frfs[j]
        beside = [self._agreement(self.axes[i], frf) for frf in reversed(both)]
        likeness = max(own.of(frf) for own, frf in zip(beside, both, strict=True))
        struck = any(own.struck(frf) for own, frf in zip(beside, both, strict=True))
        if likeness > UNLIKE and not struck:
            return None
        odd = [bool(own.elsewhere(frf)) for own, frf in zip(beside, both, strict=True)]
        # Levels of what is not linear may be unlike; they are not opposite, nor of another axis.
        if self.level[i] != self.level[j] and likeness > -UNLIKE and not any(odd):
            return None
        return None if odd[1] and not odd[0] else Doubt((j,), likeness)

    def _repeated(self, i: int) -> Doubt | None:
        for axis, centre in self._agreement(self.axes[i], self.frfs[i]).across.items():
            if abs(_likeness_in_size(self.frfs[i], centre)) >= SAME:
                others = tuple(int(j) for j in np.flatnonzero(self.axes == axis))
                return Doubt(others, _likeness(self.frfs[i], centre), AXES[axis])
        return None


def answered_as(
    hit: Hit, theirs: tuple[Hit, ...], own: tuple[Hit, ...], band_hz: tuple[float, float]
) -> bool:
    """Whether a hit is answered as `theirs` at another pose: the same, or much more like them than
    like its `own` pose's along that axis, which may be few and poor."""

    def likest(others: tuple[Hit, ...]) -> float:
        """Likeness to one of them, in size too: some may be wrong, and their mean like none."""
        same = [o for o in others if o.axis_index == hit.axis_index and _comparable(o, hit)]
        frf, *rest = _frfs((hit, *same), band_hz)
        return max((_likeness_in_size(frf, one) for one in rest), default=0.0)

    there, here = likest(theirs), likest(own)
    return there >= SAME or (here > 0 and there > max(LIKE, here + FAR_BELOW))


@dataclass(frozen=True, eq=False)
class _Agreement:
    """How hits along an axis are answered, and in `across` those along the others."""

    centre: np.ndarray
    across: dict[int, np.ndarray]

    def of(self, frf: np.ndarray) -> float:
        """Likeness of an FRF, had it been tilted to the axis as far as hands tilt at most."""
        return _likeness(self._upright(frf[None])[0], self.centre)

    def sizes(self, frfs: np.ndarray) -> np.ndarray:
        """ln of how much larger FRFs (n, N) are than half of all or more; 0 where no half differs.

        They differ both as they are and without what tilts of the hits explain, and are alike
        otherwise: what moves modes is no unit.
        """
        upright = self._upright(frfs)
        size, straight = (
            np.log(np.maximum(np.linalg.norm(f, axis=1), SILENCE)) for f in (frfs, upright)
        )
        apart = (np.abs(own[:, None] - own) for own in (size, straight))
        other = np.minimum(*apart) > OTHER_SIZE
        odd = 2 * other.sum(axis=1) >= len(frfs)
        odd &= np.array([_likeness(frf, self.centre) > LIKE for frf in upright])
        return np.array([
            size[i] - np.median(size[other[i]]) if odd[i] else 0.0 for i in range(len(frfs))
        ])  # fmt: skip

    def _upright(self, frfs: np.ndarray) -> np.ndarray:
        """FRFs (n, N) without what tilts of the hits explain.

        A hit in another unit has tilts as much smaller: one that is unlike as it is may be alike at
        the centre's size.
        """
        if not self.across:
            return frfs
        across = np.array(list(self.across.values()))
        norms = np.linalg.norm(frfs, axis=1, keepdims=True)
        size = np.where(norms > 0, norms / np.linalg.norm(self.centre), 1.0)
        both = [
            by * (self.centre + untilted(frfs / by - self.centre, across))
            for by in (np.ones_like(size), size)
        ]
        pairs = zip(*both, strict=True)
        return np.array([a if _likeness(a, self.centre) > LIKE else b for a, b in pairs])

    def elsewhere(self, frf: np.ndarray) -> str:
        """Along which other axis hits are answered as this one; "" where along none."""
        centres = self.across.items()
        return next((AXES[k] for k, other in centres if abs(_likeness(frf, other)) > LIKE), "")

    def struck(self, frf: np.ndarray) -> bool:
        """Whether an FRF is that of another axis in size too: no tilt brings in so much of it."""
        plain = _likeness(frf, self.centre)
        return any(
            abs(_likeness(frf, other)) > max(LIKE, plain + FAR_BELOW)
            and abs(np.vdot(other, frf)) > WHOLE * np.linalg.norm(other) ** 2
            for other in self.across.values()
        )

    def disagreement(self, frf: np.ndarray, same: list[np.ndarray]) -> tuple[str, str] | None:
        """Kind and text where an FRF that is unlike others of its axis is a mistake."""
        if self.of(-frf) > UNLIKE:  # modes that move make FRFs unlike, never opposite
            return "wrong_axis", "has the opposite sign of the others"
        if axis := self.elsewhere(frf):
            return "wrong_axis", f"is that of hits along {axis}"
        # A structure that is not linear answers each level differently: only hits of the same force
        # count, if they agree with each other or with all.
        if any(replace(self, centre=one).of(frf) > LIKE for one in same):
            return None
        voters = [*same, self.centre]
        agreed = any(_likeness(a, b) > LIKE for i, a in enumerate(voters) for b in voters[:i])
        return ("incoherent", "does not agree with the others of its axis") if agreed else None


def untilted(off: np.ndarray, across: np.ndarray) -> np.ndarray:
    """By what FRFs (n, N) of hits along an axis differ, without what tilts of the hits explain.

    A tilt adds a little of the FRFs `across` (k, N) of the other axes; MOST_TILT rad is the most.
    """
    normal = (across.conj() @ across.T).real
    tilts = np.linalg.lstsq(normal, (off @ across.conj().T).real.T, rcond=None)[0]
    return off - np.clip(tilts, -MOST_TILT, MOST_TILT).T @ across


def _centre(frfs: np.ndarray) -> np.ndarray:
    return np.median(frfs.real, axis=0) + 1j * np.median(frfs.imag, axis=0)


def _comparable(one: Hit, other: Hit) -> bool:
    """Whether two hits are at one point, heard by the same sensors and sampled alike."""
    places = [(hit.hit_point, hit.responses) for hit in (one, other)]
    return places[0] == places[1] and same_rate(one, other)


def _groups(
    hits: tuple[Hit, ...], band_hz: tuple[float, float]
) -> Iterator[tuple[list[int], _Alike]]:
    """Hits that can be compared with each other: their places among all, and their FRFs."""
    groups: list[list[int]] = []
    for i, hit in enumerate(hits):
        own = next((group for group in groups if _comparable(hits[group[0]], hit)), [])
        if not own:
            groups.append(own)
        own.append(i)
    return ((own, _Alike.of([hits[i] for i in own], band_hz)) for own in groups)


def _frfs(hits: Sequence[Hit], band_hz: tuple[float, float]) -> np.ndarray:
    """FRFs (n, 3·F) of hits that can be compared, of as many samples, over the same lines."""
    shortest, rate_hz = min(len(hit.force_n) for hit in hits), hits[0].sampling_rate_hz
    found = []
    for hit in hits:
        rest_n = float(np.median(hit.force_n))
        force, response = band_spectra(hit, band_hz, rest_n, shortest, rate_hz)
        power = np.maximum(np.abs(force) ** 2, (1e-3 * np.max(np.abs(force))) ** 2)
        found.append((response * force.conj() / power).ravel())
    return np.array(found)


def _likeness(frf: np.ndarray, centre: np.ndarray) -> float:
    """1 where two FRFs are the same in size, sign and phase; 0 or less where unrelated."""
    scale = np.linalg.norm(frf) * np.linalg.norm(centre)
    return float(np.real(np.vdot(centre, frf)) / scale) if scale > 0 else 0.0


def _likeness_in_size(frf: np.ndarray, other: np.ndarray) -> float:
    """The same, less where they differ in size."""
    sizes = float(np.linalg.norm(frf)), float(np.linalg.norm(other))
    return _likeness(frf, other) * (min(sizes) / max(*sizes, SILENCE))


# ln of what FRFs grow by where a file is in another unit than its repeats, and how near that is.
UNITS = {-np.log(9.80665): "g instead of m/s²", np.log(4.44822): "lbf instead of N"}
NEAR_UNIT = 0.1


def outvoted(sizes: np.ndarray) -> bool:
    """Whether most of three hits and more are of the usual size, so that the others are wrong."""
    return bool(len(sizes) > 2 and 2 * np.count_nonzero(sizes) < len(sizes))


def other_size(size: float, others: str) -> str:
    """What is said of a hit that is larger than `others`, by the ln of how much, and which unit."""
    own = [unit for grown, unit in UNITS.items() if abs(size - grown) < NEAR_UNIT]
    theirs = [f"those in {unit}" for grown, unit in UNITS.items() if abs(size + grown) < NEAR_UNIT]
    unit, way = "".join(own or theirs), "larger" if size > 0 else "smaller"
    unit = unit or "another unit or sensitivity"
    return f"has an FRF {np.exp(abs(size)):.2g} times {way} than {others}: {unit}?"
