"""Files that were read lately, so that none is parsed again for each of its hits."""

from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass
from threading import Lock

import numpy as np

from planner.recording.records import FrfRecord, Record


@dataclass(frozen=True, eq=False)
class ReadFile:
    """The records of a file as they are, and cut into hits."""

    whole: tuple[Record, ...]
    hits: tuple[Record, ...]

    @property
    def nbytes(self) -> int:
        """What its numbers take up."""
        arrays = {id(a): a.nbytes for r in (*self.whole, *self.hits) for a in _arrays(r)}
        return sum(arrays.values())


class ReadFiles:
    """The files read last, as many as `most_bytes` hold, the last one in any case."""

    def __init__(self, most_bytes: int):
        self._most_bytes, self._lock = most_bytes, Lock()
        self._files: OrderedDict[Hashable, ReadFile] = OrderedDict()

    def get(self, key: Hashable) -> ReadFile | None:
        """What was read under a key; None where it is not remembered."""
        with self._lock:
            if key in self._files:
                self._files.move_to_end(key)
            return self._files.get(key)

    def put(self, key: Hashable, file: ReadFile) -> None:
        """Remember a file, and forget those that were asked for longest ago."""
        with self._lock:
            self._files[key] = file
            while sum(f.nbytes for f in self._files.values()) > self._most_bytes:
                if len(self._files) == 1:
                    return
                self._files.popitem(last=False)


def _arrays(record: Record) -> list[np.ndarray]:
    if isinstance(record, FrfRecord):
        return [record.frequency_hz, record.values, record.coherence]
    return [channel.samples for channel in record.channels]
