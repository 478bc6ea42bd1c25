"""Where what can be computed again is kept between runs."""

import os
import sys
from pathlib import Path


def folder(name: str) -> Path:
    """The user's folder for a kind of cache; RuntimeError for a user without a home."""
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    own = "Library/Caches" if sys.platform == "darwin" else ".cache"
    return (Path(base) if base else Path.home() / own) / "planner" / name
