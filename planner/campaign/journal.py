"""The append-only log: JSON lines, each chained to the one before, synced to disk per event.

A line is {"check": c, "entry": {...}}; c is the head of sha256(previous check + entry bytes), so
that a change anywhere is found. Only the last line can have been torn by a crash: it is cut off,
and set aside, before anything is appended.
"""

import hashlib
import os
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import msgspec
from filelock import FileLock, Timeout

from planner.campaign.events import AnyEvent, Entry
from planner.errors import InputError, JournalError

_ENTRY = msgspec.json.Decoder(Entry)
_ENCODER = msgspec.json.Encoder()


class _Line(msgspec.Struct):
    check: str
    entry: msgspec.Raw


_LINE = msgspec.json.Decoder(_Line)


@dataclass(frozen=True)
class LogContent:
    """The whole events of a log, the check of the last, and the bytes of a torn tail."""

    entries: tuple[Entry, ...]
    check: str
    whole_bytes: int
    torn: bytes
    newline_missing: bool = False


def _chain(check: str, entry: bytes) -> str:
    return hashlib.sha256(check.encode() + entry).hexdigest()[:16]


def encode_line(previous_check: str, entry: Entry) -> tuple[bytes, str]:
    """One line of the log and its check."""
    body = _ENCODER.encode(entry)
    check = _chain(previous_check, body)
    return b'{"check":"%s","entry":%s}\n' % (check.encode(), body), check


START = b'{"check":"'  # of a line; within one, quotes are escaped


def parse(data: bytes, name: str = "log.jsonl") -> LogContent:
    """Read a log; JournalError where it is damaged before its last line."""
    entries: list[Entry] = []
    check, position = "", 0
    while position < len(data):
        end = data.find(b"\n", position)
        stop = len(data) if end < 0 else end + 1
        entry, new_check = _read_line(data[position:stop], check, len(entries) + 1)
        if entry is None:
            # A write that was cut short leaves the beginning of one line, never two.
            if stop < len(data) or START in data[position + 1 :]:
                raise JournalError(
                    f"{name}, line {len(entries) + 1}, is damaged and whole lines follow it; "
                    f"restore the file from a copy (the lines before it are intact)."
                )
            return LogContent(tuple(entries), check, position, data[position:])
        entries.append(entry)
        check, position = new_check, stop
    missing = bool(data) and not data.endswith(b"\n")
    return LogContent(tuple(entries), check, position, b"", missing)


def _read_line(line: bytes, check: str, seq: int) -> tuple[Entry | None, str]:
    try:
        parsed = _LINE.decode(line)
        body = bytes(parsed.entry)
        entry = _ENTRY.decode(body)
    except (msgspec.DecodeError, UnicodeDecodeError):
        return None, check
    new_check = _chain(check, body)
    if parsed.check != new_check or entry.seq != seq:
        return None, check
    return entry, new_check


class Journal:
    """The log file of one campaign, opened for reading, or for writing under its lock."""

    def __init__(self, path: Path):
        self.path = path
        self._content = self._load()

    @property
    def entries(self) -> tuple[Entry, ...]:
        """All whole entries, in order."""
        return self._content.entries

    @property
    def torn_bytes(self) -> int:
        """Length of a torn last line that the next writer will set aside."""
        return len(self._content.torn)

    def _load(self) -> LogContent:
        try:
            return parse(self.path.read_bytes(), str(self.path))
        except FileNotFoundError:
            folder = self.path.parent
            raise InputError(
                f"{folder} is not a campaign folder (no {self.path.name}); "
                f"start one with: planner new {folder} --robot ROBOT_TOML"
            ) from None

    @contextmanager
    def writing(self, wait_s: float = 10.0):
        """Hold the campaign's lock, having re-read the log and repaired its tail.

        The lock is the operating system's: it ends with the process, however that ends.
        """
        lock = FileLock(str(self.path.with_suffix(".lock")))
        try:
            lock.acquire(timeout=wait_s)
        except Timeout:
            raise InputError(
                f"{self.path.parent} is in use by another planner; close that one first."
            ) from None
        try:
            self._content = self._load()
            self._repair_tail()
            yield self
        finally:
            lock.release()

    def _repair_tail(self) -> None:
        content = self._content
        if content.torn:
            aside = self.path.with_name(f"{self.path.name}.torn-{content.whole_bytes}")
            write_synced(aside, content.torn)
            with open(self.path, "r+b") as file:
                file.truncate(content.whole_bytes)
                os.fsync(file.fileno())
        elif content.newline_missing:
            _append_synced(self.path, b"\n")
        self._content = LogContent(content.entries, content.check, content.whole_bytes, b"")

    def append(self, event: AnyEvent) -> Entry:
        """Write one event and return only once it is on the disk."""
        content = self._content
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        entry = Entry(len(content.entries) + 1, now, event)
        line, check = encode_line(content.check, entry)
        _append_synced(self.path, line)
        whole = content.whole_bytes + len(line)
        # Decoded again, so that what is used now is what a later reading will give.
        decoded, _ = _read_line(line, content.check, entry.seq)
        assert decoded is not None
        self._content = LogContent((*content.entries, decoded), check, whole, b"")
        return decoded


def _append_synced(path: Path, data: bytes) -> None:
    with open(path, "ab") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def write_synced(path: Path, data: bytes) -> None:
    """Write a file so that it is either whole under its name, or absent."""
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    with open(partial, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(partial, path)
    sync_folder(path.parent)


def sync_folder(path: Path) -> None:
    """Make a rename in the folder durable (where the system lets a folder be opened)."""
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    except OSError:
        pass
    finally:
        os.close(handle)
