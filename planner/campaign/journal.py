"""The append-only log: JSON lines, each chained to the one before, synced to disk per event.

A line is {"check": c, "entry": {...}}; c is the head of sha256(previous check + entry bytes), so
that a change anywhere is found. Only the last line can have been torn by a crash: it is cut off,
and set aside, before anything is appended.
"""

import getpass
import hashlib
import os
import socket
import sys
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from filelock import FileLock, Timeout

from planner import file_content
from planner.campaign.events import AnyEvent, Entry
from planner.errors import InputError, JournalError
from planner.version import __version__
from planner.words import command

T = TypeVar("T")


class _Line(msgspec.Struct):
    check: str
    entry: msgspec.Raw


@dataclass(frozen=True)
class LogContent:
    """The whole events of a log, the check of the last, and the bytes of a torn tail."""

    entries: tuple[Entry, ...]
    check: str
    whole_bytes: int
    torn: bytes


def _chain(check: str, entry: bytes) -> str:
    return hashlib.sha256(check.encode() + entry).hexdigest()[:16]


def encode_line(previous_check: str, entry: Entry) -> tuple[bytes, str]:
    """One line of the log and its check."""
    body = msgspec.json.encode(entry)
    check = _chain(previous_check, body)
    return b'{"check":"%s","entry":%s}\n' % (check.encode(), body), check


BRIEFLY_S = 0.5  # in which most acts are over
SESSION = ", a session"  # ends what is said of who holds a campaign for long
PART = ".part"  # ends the name of a file in the making
START = b'{"check":"'  # of a line; within one, quotes are escaped


def parse(data: bytes, name: str = "log.jsonl") -> LogContent:
    """Read a log; JournalError where it is damaged before its last line."""
    entries: list[Entry] = []
    check, position = "", 0
    while position < len(data):
        end = data.find(b"\n", position)
        stop = len(data) if end < 0 else end + 1
        entry, new_check = _read_line(data[position:stop], check, len(entries) + 1, name)
        if entry is None or (end < 0 and not data.endswith(b"}")):
            # A write that was cut short leaves the beginning of one line: no newline, no other.
            seq = len(entries) + 1
            whole, _ = _read_line(data[position : stop - 1], check, seq, name)
            if end >= 0 or START in data[position + 1 :] or whole is not None:
                raise JournalError(
                    f"{name}, line {seq}, is damaged; restore the file from a copy "
                    f"(the lines before it are intact)."
                )
            break
        entries.append(entry)
        check, position = new_check, stop
    return LogContent(tuple(entries), check, position, data[position:])


def _read_line(line: bytes, check: str, seq: int, name: str) -> tuple[Entry | None, str]:
    """Entry and check of a line; None where it is damaged.

    Raises JournalError where the line is whole, as its check says, and this program cannot read it.
    """
    try:
        parsed = msgspec.json.decode(line, type=_Line)
    except (msgspec.DecodeError, UnicodeDecodeError):
        return None, check
    body = bytes(parsed.entry)
    new_check = _chain(check, body)
    if parsed.check != new_check:
        return None, check
    try:
        entry = msgspec.json.decode(body, type=Entry)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise JournalError(
            f"{name}, line {seq}, is whole, but planner {__version__} does not know what it says "
            f"({error}); a newer planner wrote it: update planner."
        ) from None
    return (entry, new_check) if entry.seq == seq else (None, check)


class Journal:
    """The log file of one campaign, opened for reading, or for writing under its lock."""

    def __init__(self, path: Path):
        self.path = path
        self._lock = FileLock(str(path.with_suffix(".lock")))
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
            return parse(file_content.read(self.path), str(self.path))
        except FileNotFoundError:
            folder = self.path.parent
            raise InputError(
                f"{folder} is not a campaign folder (no {self.path.name}); "
                f"start one with: {command('planner', 'new', folder)} --robot ROBOT_TOML"
            ) from None

    @contextmanager
    def writing(self, wait_s: float = 10.0):
        """Hold the campaign's lock, having re-read the log and repaired its tail.

        The lock is the operating system's: it ends with the process, however that ends.
        """
        with self.holding(wait_s):
            self._content = self._load()
            self._repair_tail()
            yield self

    @contextmanager
    def holding(self, wait_s: float = 10.0, session: bool = False):
        """Hold the campaign's lock: nobody else writes meanwhile. Acts within need not wait.

        An act of another is waited for, a `session` is not: it may last for hours. Raises
        InputError that names who holds the lock.
        """
        holder = self.path.with_suffix(".holder")
        self._acquire(holder, wait_s)
        try:
            if self._lock.lock_counter == 1:
                with suppress(OSError):  # only for the eyes of others
                    holder.write_text(_who() + SESSION * session, encoding="utf-8")
            yield self
        finally:
            if self._lock.lock_counter == 1:
                with suppress(OSError):
                    holder.unlink(missing_ok=True)
            self._lock.release()

    def _acquire(self, holder: Path, wait_s: float) -> None:
        for seconds in (min(BRIEFLY_S, wait_s), max(0.0, wait_s - BRIEFLY_S)):
            try:
                self._lock.acquire(timeout=seconds)
                return
            except Timeout:
                who = "another planner"
                with suppress(OSError, UnicodeDecodeError):
                    who = holder.read_text(encoding="utf-8").strip() or who
                if who.endswith(SESSION):
                    break
        raise InputError(f"{self.path.parent} is in use by {who}; close that one first.")

    def _repair_tail(self) -> None:
        content = self._content
        remove_parts(self.path.parent)
        if content.torn:
            aside = self.path.with_name(f"{self.path.name}.torn-{content.whole_bytes}")
            write_synced(aside, content.torn)
            with open(self.path, "r+b") as file:
                file.truncate(content.whole_bytes)
                os.fsync(file.fileno())
            self._content = self._load()
        elif content.entries and not file_content.read(self.path).endswith(b"\n"):
            _append_synced(self.path, b"\n")

    def append(self, event: AnyEvent) -> Entry:
        """Write one event and return only once it is on the disk."""
        content = self._content
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        entry = Entry(len(content.entries) + 1, now, event)
        _append_synced(self.path, encode_line(content.check, entry)[0])
        self._content = self._load()  # what is used now is what a later reading will give
        return self.entries[-1]


def _who() -> str:
    """This process, for the sentence that another one says."""
    command = " ".join(Path(word).name for word in sys.argv[:2]) or "planner"
    return (
        f"{command} (process {os.getpid()} of {getpass.getuser()} on {socket.gethostname()}, since "
        f"{datetime.now().astimezone():%H:%M})"
    )


def _append_synced(path: Path, data: bytes) -> None:
    """Append to a file; where that fails (a full disk) the file is as it was before."""
    before = path.stat().st_size
    try:
        with open(path, "ab") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
    except OSError:
        with suppress(OSError), open(path, "r+b") as file:
            file.truncate(before)
        raise


def write_synced(path: Path, data: bytes) -> None:
    """Write a file so that it is either whole under its name, or absent."""
    partial = path.with_name(f".{path.name}.{os.getpid()}{PART}")
    try:
        with open(partial, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, path)
    except BaseException:  # a full disk would stay full of halves
        partial.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def remove_parts(folder: Path) -> None:
    """Remove what writers of this folder left half-written when they were killed.

    Only for the one writer of a folder: another's parts may be in the making.
    """
    for part in folder.glob(f".*{PART}"):
        if part.is_file():
            part.unlink(missing_ok=True)


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


class _Checked(msgspec.Struct):
    check: str
    kept: msgspec.Raw


def write_checked(path: Path, value: Any) -> None:
    """Keep what msgspec can encode; the file is whole under its name, or absent."""
    body = msgspec.json.encode(value)
    check = hashlib.sha256(body).hexdigest()
    write_synced(path, b'{"check":"%s","kept":%s}' % (check.encode(), body))


def read_checked(path: Path, kind: type[T]) -> T | None:
    """What was kept; None where nothing was, or where it is damaged (then the file exists)."""
    try:
        found = msgspec.json.decode(path.read_bytes(), type=_Checked)
        if hashlib.sha256(bytes(found.kept)).hexdigest() != found.check:
            return None
        return msgspec.json.decode(found.kept, type=kind)
    except (OSError, UnicodeDecodeError, msgspec.DecodeError):
        return None
