"""HDF5 files (MATLAB's v7.3 among them): one dataset a channel, nothing taken from elsewhere."""

from pathlib import Path
from typing import TYPE_CHECKING

from planner.errors import InputError
from planner.recording.entries import check_size, columns_of, text_of
from planner.recording.named_columns import Named, to_records
from planner.recording.records import Record

if TYPE_CHECKING:
    import h5py

MOST_OBJECTS = 10_000  # groups and datasets that are looked at


def read_hdf5(path: Path) -> tuple[Record, ...]:
    """HDF5 files with one dataset per channel; attributes of the file and its root count too.

    Raises InputError where two groups hold the same names (each is a hit of its own), and where
    numbers lie in another file: the copy that a campaign keeps would be without them.
    """
    import h5py

    entries: dict[str, object] = {}
    units: dict[str, str] = {}
    try:
        with h5py.File(path, "r") as file:
            entries.update(file.attrs.items())
            for name, dataset in _datasets(path, file).items():
                entries[name] = dataset[()]
                if "unit" in dataset.attrs:
                    units[name] = text_of(dataset.attrs["unit"])
    except InputError:
        raise
    except Exception as error:  # the library raises whatever the junk makes it raise
        raise InputError(
            f"{path} is not a readable HDF5 file ({type(error).__name__}); export it again."
        ) from None
    named = columns_of(path, entries)
    return to_records(path, Named(named.columns, units, named.attributes))


def _datasets(path: Path, file: "h5py.File") -> "dict[str, h5py.Dataset]":
    """Vectors and single values by the last part of their name, none of them read yet."""
    import h5py

    found: dict[str, h5py.Dataset] = {}
    where: dict[str, str] = {}
    seen, elsewhere, vectors = [0], [], 0

    def link(name: str, what: object) -> None:
        if isinstance(what, h5py.ExternalLink):
            elsewhere.append(name)

    def visit(name: str, item: object) -> bool | None:
        seen[0] += 1
        if seen[0] > MOST_OBJECTS:
            raise InputError(f"{path} holds more than {MOST_OBJECTS} objects; export a hit a file.")
        if isinstance(item, h5py.Dataset):
            short = name.rsplit("/", maxsplit=1)[-1]
            if item.is_virtual or item.external:
                elsewhere.append(name)
            elif short in found:
                raise InputError(
                    f"{path} holds {short} twice, as {where[short]} and as {name}; export each "
                    f"hit into a file of its own."
                )
            elif sum(size > 1 for size in item.shape or ()) <= 1:
                found[short], where[short] = item, name
        return None

    file.visititems_links(link)
    file.visititems(visit)
    if elsewhere:
        raise InputError(
            f"{path}: {elsewhere[0]} lies in another file, which would not be kept; export all "
            f"channels into one file."
        )
    vectors = [d for d in found.values() if d.size]
    check_size(path, sum(d.size * d.dtype.itemsize for d in vectors))
    return found
