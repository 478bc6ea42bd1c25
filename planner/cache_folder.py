"""Where what can be computed again is kept between runs."""

from pathlib import Path

import platformdirs


def folder(name: str) -> Path:
    """The user's folder for a kind of cache; RuntimeError for a user without a home."""
    path = platformdirs.user_cache_path("planner", appauthor=False)
    if not path.is_absolute():
        raise RuntimeError("There is no home folder.")
    return path / name
