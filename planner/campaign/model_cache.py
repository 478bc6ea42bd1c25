"""Models of campaigns kept on disk, so that the next command loads what the last one fitted.

An entry is named by the hash of all that its model is a function of: the campaign's folder, its
configuration and robot files, the measurements in use, this program's text and its libraries.
Models are pickled: they hold the robot and the identified simulation, and come back bit by bit.
"""

import pickle
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from planner import cache_folder, content_hash
from planner.campaign.events import Configured
from planner.campaign.state import Measurement
from planner.dataset.store import Store

if TYPE_CHECKING:
    from planner.campaign.model import Model

MOST_BYTES = 256 * 1024 * 1024  # about fifty models
LIBRARIES = "msgspec", "numpy", "scipy", "jax", "jaxlib", "pin"


def user_models() -> Store:
    """This user's models; a store that keeps nothing where there is no home."""
    try:
        return Store(cache_folder.folder("models"), MOST_BYTES)
    except RuntimeError:
        return Store(None)


def key(what: str, directory: Path, configured: Configured, used: tuple[Measurement, ...]) -> str:
    """Name of an entry.

    Args:
        what: What is kept: the model, or something that follows from it.
        directory: The campaign's folder; the robot of a model knows its files by their paths.
        configured: Configuration and hashes of the robot's files.
        used: Measurements that the model uses, in their order; hits by their files' hashes.
    """
    measured = tuple(replace(m, time="") for m in used)
    told = content_hash.of(configured), content_hash.of(measured)
    computes = content_hash.program(), content_hash.libraries(*LIBRARIES)
    return content_hash.digest(what, *computes, str(directory.resolve()), *told)


def kept_model(store: Store, name: str) -> "Model | None":
    """The model of that key, with all that was worked out before it was kept; None: not there."""
    data = store.get(name, bytes)
    if data is None:
        return None
    from planner.campaign.model import Model

    try:
        model = pickle.loads(data)  # this user's own file, its checksum and program verified
    except Exception:  # whatever a library makes of it, the model is fitted again
        return None
    return model if isinstance(model, Model) else None


def keep_model(store: Store, name: str, model: "Model") -> None:
    """Keep a model; one that a library cannot pickle only costs the time to fit it again."""
    if store.folder is None:
        return
    try:
        data = pickle.dumps(model, pickle.HIGHEST_PROTOCOL)
    except (pickle.PicklingError, TypeError, AttributeError, RuntimeError):
        return
    store.put(name, data)
