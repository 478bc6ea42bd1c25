"""Logs as versions wrote them that had less in their models."""

import hashlib
from pathlib import Path

from planner.campaign.events import Configured
from planner.campaign.journal import encode_line, parse

GRAVITY, SCATTER = b',"geometric_stiffness":true', b',"visit_scatter":true'
ERRING = b',"hits_err":true'


def written_earlier(cell: Path, left_out: tuple[bytes, ...]) -> Path:
    """The log as versions wrote it that left this out of the model: they do not mention it."""
    path, check, lines = cell / "log.jsonl", "", []
    for entry in parse(path.read_bytes()).entries:
        line, _ = encode_line(check, entry)
        body = line.split(b'"entry":', 1)[1]
        for later in left_out:
            assert (later in body) == isinstance(entry.event, Configured)
            body = body.replace(later, b"")
        line, check = _chained(check, body[:-2])
        lines.append(line)
    path.write_bytes(b"".join(lines))
    return cell


def _chained(check: str, body: bytes) -> tuple[bytes, str]:
    check = hashlib.sha256(check.encode() + body).hexdigest()[:16]
    return b'{"check":"%s","entry":%s}\n' % (check.encode(), body), check
