"""Work on a Dask cluster; the death of a worker costs the items that it held."""

import logging
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from planner.compare.processes import ATTEMPTS, Failure, attempt
from planner.errors import InputError

CONNECT_TIMEOUT_S = 10.0  # for the scheduler, and for its first worker


def each(
    function: Callable[[Any, Any], Any], shared: Any, items: Sequence[Any], address: str
) -> Iterator[tuple[int, Any]]:
    """As `processes.each`, on the workers of the scheduler at an address.

    Raises InputError where none answers or none has a worker.
    """
    from distributed import as_completed

    with _connected(address) as client:
        left = list(range(len(items)))
        for _ in range(ATTEMPTS):
            # Workers that died may have held the only copy.
            data = client.scatter(shared, broadcast=True, hash=False)
            futures = {
                client.submit(attempt, function, data, items[i], pure=False): i for i in left
            }
            left = []
            for future in as_completed(futures, loop=client.loop):
                index = futures.pop(future)
                if future.status == "finished":
                    yield index, future.result()
                else:
                    left.append(index)
            if not left:
                return
        for index in left:
            yield index, Failure(f"The workers that ran it died {ATTEMPTS} times.")


def _connected(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            "--scheduler needs Dask, which is not installed; run pip install 'planner[dask]'."
        ) from None
    # What Dask has to say of lost connections is said here in one sentence.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=CONNECT_TIMEOUT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(
            f"No Dask scheduler answers at {address} ({type(error).__name__}); start one with "
            f"`dask scheduler` and name its address."
        ) from None
    try:
        client.wait_for_workers(1, timeout=CONNECT_TIMEOUT_S)
    except TimeoutError:
        client.close()
        raise InputError(
            f"The Dask scheduler at {address} has no worker; start some with `dask worker "
            f"{address} --nthreads 1`."
        ) from None
    return client
