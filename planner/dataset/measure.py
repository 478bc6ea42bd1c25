"""From the files of one pose to its modes: read, screen, average, identify; each step once."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from planner import content_hash
from planner.dataset.screened_files import FileVerdict, ScreenedFiles, Source, read_files, renamed
from planner.dataset.store import Store, user_store
from planner.errors import InputError, RefusedError
from planner.frf.frf import Frf
from planner.modal.modes import Homogeneity, ModalModel
from planner.recording.points import SENSOR, TCP
from planner.recording.read import digest
from planner.recording.records import FrfRecord, Hit

DEFAULT_BAND_HZ = (4.0, 60.0)  # in which modes of a pose are looked for
OVER = 7.5  # e^−OVER, 0.06 %, of a decay that does not damp is left where the record ends
PACKAGES = "recording", "frf", "modal", "dataset", "inference"  # that results here depend on

NOT_OF_TOOL = (
    "No hit at the tcp was heard by all axes of the sensor there: modes of the tool are not told, "
    "what was measured at other points serves identification and diagnosis."
)

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Averaged:
    """FRF of a pose; None where nothing could be used. `remarks` says why, or what to know."""

    verdicts: tuple[FileVerdict, ...]
    frf: Frf | None
    remarks: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Decomposed:
    """Modes of a pose's FRF and the comparison of its force levels (None: one level only)."""

    modal: ModalModel | None
    homogeneity: Homogeneity | None
    remarks: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class MeasuredPose:
    """One pose's recordings and what follows from them, computed when first asked for and kept.

    FRFs and modes are looked up in `store`, the user's, before files are read. `given` are hits
    that are at hand already and are used as they are; there are no files then, nothing is stored.
    """

    sources: tuple[Source, ...]
    band_hz: tuple[float, float]
    estimator: str = "h1"
    window_rate_1_s: float = 0.0  # of an exponential window that the analyser laid over all
    given: tuple[Hit, ...] = ()
    store: Store = field(default_factory=user_store)

    @cached_property
    def files(self) -> ScreenedFiles:
        """The files, read and screened."""
        if self.given:
            return ScreenedFiles((), (self.given,), self.given, ())
        return read_files(self.sources, self.band_hz)

    @property
    def hits(self) -> tuple[Hit, ...]:
        """The hits that the FRF is the average of."""
        return self.files.agreeing

    @cached_property
    def averaged(self) -> Averaged:
        """FRF of all good hits, or of exported FRFs where there are no hits; a verdict a file."""
        return self.kept("frf", Averaged, self._average)

    @cached_property
    def verdicts(self) -> tuple[FileVerdict, ...]:
        """One per file: none is dropped in silence."""
        # What was kept may have been read from another copy of the same files.
        both = zip(self.averaged.verdicts, self.sources, strict=True)
        return tuple(replace(verdict, source=source) for verdict, source in both)

    @property
    def frf(self) -> Frf | None:
        """The tool's part of `whole`: hits at the tcp, and the sensor there; None without."""
        return None if self.whole is None else self.whole.of_tool

    @property
    def whole(self) -> Frf | None:
        """Of all points, see `averaged`."""
        return self.averaged.frf

    @cached_property
    def ended_frf(self) -> Frf | None:
        """`whole` under an exponential window by which decays are over; exported ones as they are.

        What the window does is part of the model (`Frf.exponential_rate_1_s`).
        """
        plain = self.whole
        if plain is None or not np.isfinite(plain.tail_s):
            return plain
        return self.kept("ended frf", Frf, lambda: self._ended(plain, "weighted"))

    @cached_property
    def one_hit_frf(self) -> Frf | None:
        """The FRF of one hit in the middle of all, with the variance of the noise alone.

        For fits that integrate over how hits miss. As `ended_frf`; what the records still cut off
        is too small to matter.
        """
        plain = self.whole
        if plain is None or not self.hits:
            return plain
        found = self.kept("one hit frf", Frf, lambda: self._ended(plain, "one_hit"))
        return replace(found, tail_s=np.inf) if found.exponential_rate_1_s > 0 else found

    @cached_property
    def decomposed(self) -> Decomposed:
        """Modes, where there is an FRF."""
        return self.kept("modes", Decomposed, self._decompose)

    @property
    def modal(self) -> ModalModel | None:
        """See `decomposed`."""
        return self.decomposed.modal

    @property
    def homogeneity(self) -> Homogeneity | None:
        """See `decomposed`."""
        return self.decomposed.homogeneity

    @property
    def remarks(self) -> tuple[str, ...]:
        """On FRF and modes."""
        return *self.averaged.remarks, *self.decomposed.remarks

    @property
    def is_kept(self) -> bool:
        """Whether FRF and modes are in the store, so that they cost nothing."""
        return all(self.store.has(self._key(what)) for what in ("frf", "modes"))

    def kept(self, what: str, kind: type[T], make: Callable[[], T]) -> T:
        """From the store, or made and kept there."""
        if self.given:
            return make()
        key = self._key(what)
        found = self.store.get(key, kind)
        if found is None:
            found = make()
            if _digest(self.sources) == self._contents:  # no file changed while it was read
                self.store.put(key, found)
        return found

    @cached_property
    def _contents(self) -> str:
        """Hash of the files' content, taken before they are read."""
        return _digest(self.sources)

    def _key(self, what: str) -> str:
        """Hash of the files' content and of all else that a result depends on."""
        told = [(s.name, s.path.suffix, s.hit, s.repeat, s.stated, s.part) for s in self.sources]
        how = self.band_hz, self.estimator, self.window_rate_1_s
        return content_hash.digest(
            what, program(), content_hash.of(told), content_hash.of(how), self._contents
        )

    def _average(self) -> Averaged:
        files = self.files
        said = files.verdicts
        if not files.agreeing and not files.records:
            return Averaged(said, None, ("No usable hit: nothing was estimated.",))
        try:
            how = self.band_hz, self.estimator, self.window_rate_1_s
            frf = frf_of(files.agreeing, files.records, *how)
        except RefusedError as error:
            return Averaged(said, None, (renamed(str(error), self.sources),))
        return Averaged(said, frf, frf.remarks)

    def _ended(self, plain: Frf, estimator: str) -> Frf:
        from planner.frf.estimator import estimate

        stated = self.window_rate_1_s
        rate = max(0.0, OVER / plain.tail_s - stated)
        return estimate(self.hits, self.band_hz, estimator, rate, window_rate_1_s=stated)

    def _decompose(self) -> Decomposed:
        from planner.modal.estimate_modes import estimate_modes
        from planner.modal.homogeneity import homogeneity

        if self.frf is None:
            return Decomposed(None, None, () if self.whole is None else (NOT_OF_TOOL,))
        try:
            modal = estimate_modes(self.frf, self.band_hz)
        except RefusedError as error:
            return Decomposed(None, None, (str(error),))
        hits = of_tool(self.hits)
        found = homogeneity(hits, modal, self.band_hz, self.window_rate_1_s) if hits else None
        levels, remark = found or (None, "")
        return Decomposed(modal, levels, (*modal.remarks, *filter(None, (remark,))))


def of_tool(hits: tuple[Hit, ...]) -> tuple[Hit, ...]:
    """Hits at the tcp as the sensor there has them."""
    heard = (hit.channels_of(SENSOR) for hit in hits if hit.hit_point == TCP)
    return tuple(hit for hit in heard if hit is not None)


def program() -> str:
    """What computes: this program's text and the libraries under it."""
    return content_hash.program(*PACKAGES) + content_hash.libraries("numpy", "scipy")


def _digest(sources: tuple[Source, ...]) -> str:
    """Of all files' content; a file that cannot be read counts as it is named nowhere else."""
    contents = []
    for source in sources:
        try:
            contents.append(digest(source.path))
        except (OSError, InputError) as error:
            contents.append(f"{source.path}: {error}")
    return content_hash.digest(*contents)


def measure(
    sources: tuple[Source, ...],
    band_hz: tuple[float, float],
    estimator: str = "h1",
    window_rate_1_s: float = 0.0,
    store: Store | None = None,
) -> MeasuredPose:
    """Read and screen every file, estimate the FRF from the good hits and the modes from it.

    A file that cannot be used is refused with its reason, never dropped in silence.
    `window_rate_1_s` is that of an exponential window e^(−rate·t) that the analyser has laid over
    all channels: it is part of what is fitted, so that damping comes out without it. Results are
    looked up in `store`, by default the user's.
    """
    found = MeasuredPose(sources, band_hz, estimator, window_rate_1_s, (), store or user_store())
    _ = found.decomposed  # so that what is wrong with the files is said here
    return found


def frf_of(
    hits: tuple[Hit, ...],
    records: tuple[FrfRecord, ...],
    band_hz: tuple[float, float],
    estimator: str,
    window_rate_1_s: float,
) -> Frf:
    """The average of good hits, or exported FRFs where there are none; raises RefusedError."""
    from planner.frf.estimator import estimate
    from planner.frf.matrix import from_records

    if hits:
        return estimate(hits, band_hz, estimator, window_rate_1_s=window_rate_1_s)
    return from_records(records, window_rate_1_s)
