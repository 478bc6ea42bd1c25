"""JAX as the compiled functions here want it, with nothing changed for anybody else.

`compiled` replaces jax.jit: while such a function runs, JAX computes in float64 and refuses to
broadcast arrays of different rank, and BLAS has one thread; what was configured before holds again
afterwards, and the results are NumPy arrays.
"""

import os
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, wraps
from pathlib import Path
from typing import Any, Literal

import jax
import numpy as np
from jax.experimental.compilation_cache import compilation_cache
from threadpoolctl import ThreadpoolController

from planner import content_hash

# Matrices here are small: threads gain nothing, and on few cores nested parallel LAPACK calls
# wait for each other for ever. NPROC is how XLA learns the size of its thread pool; it and the
# flags are read once, when the backend starts.
START = {"NPROC": "1", "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false"}

Options = dict[str, bool | int | str]
# Less time to compile, and about as fast for many small matrices; wide vectors are a fifth faster.
WIDE: Options = {"xla_cpu_prefer_vector_width": "512"}
QUICK: Options = {
    "xla_cpu_use_fusion_emitters": False, "xla_backend_optimization_level": 1, **WIDE,
}  # fmt: skip
# "quick" for what the first fit of a campaign waits for, "wide" for loops that run long.
TUNED: dict[str, Options | None] = {"plain": None, "quick": QUICK, "wide": WIDE}

# Everything that was compiled in 0.1 s or more is kept on the disk, however small it is.
KEEP = {
    "jax_persistent_cache_min_compile_time_secs": 0.1,
    "jax_persistent_cache_min_entry_size_bytes": 0,
}

_compiling = threading.RLock()


@contextmanager
def numerics() -> Iterator[None]:
    """Float64 and strict ranks for what is traced and computed in this context (this thread)."""
    with jax.enable_x64(True), jax.numpy_rank_promotion("raise"):
        yield


def compiled(
    tuned: Literal["plain", "quick", "wide"] = "plain", static_argnums: int | tuple[int, ...] = ()
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """A decorator as jax.jit for functions of positional arguments that are arrays or static.

    The arguments at `static_argnums` are compiled in. Results are NumPy arrays, except inside
    another compiled function.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        seen: set[tuple] = set()

        @cache
        def jitted() -> Callable[..., Any]:
            options = TUNED[tuned] if _backend_understands_options() else None
            return jax.jit(function, static_argnums=static_argnums, compiler_options=options)

        @wraps(function)
        def call(*args: Any) -> Any:
            key = tuple(_signature(one) for one in args)
            if key in seen:
                with _blas().limit(limits=1), numerics():
                    return _numpy(jitted()(*args))
            if any(isinstance(one, jax.core.Tracer) for one in args):
                return jitted()(*args)
            with _compiling, _blas().limit(limits=1), numerics():
                run = jitted()
                with _kept_on_disk():
                    found = _numpy(run(*args))
                seen.add(key)
                return found

        return call

    return decorate


@cache
def _blas() -> ThreadpoolController:
    """Of SciPy's, which XLA calls: loaded later, it would not know of limits that hold already.

    Its threads wait for each other a hundred times longer than small matrices take.
    """
    import scipy.linalg  # noqa: F401

    return ThreadpoolController()


def _signature(argument: Any) -> Any:
    shape = getattr(argument, "shape", None)
    if shape is not None:
        return shape, argument.dtype
    if isinstance(argument, tuple):
        return tuple(_signature(one) for one in argument)
    return type(argument) if isinstance(argument, int | float | complex) else argument


def _numpy(found: Any) -> Any:
    """Arrays as NumPy's; what is still being traced as it is."""
    return jax.tree.map(lambda a: a if isinstance(a, jax.core.Tracer) else np.asarray(a), found)


@cache
def _backend_understands_options() -> bool:
    """Start JAX's backend, if nobody has; whether this XLA knows the options of `TUNED`."""
    before = {name: os.environ.get(name) for name in START}
    os.environ.setdefault("NPROC", START["NPROC"])
    if START["XLA_FLAGS"] not in os.environ.get("XLA_FLAGS", ""):
        flags = f"{os.environ.get('XLA_FLAGS', '')} {START['XLA_FLAGS']}"
        os.environ["XLA_FLAGS"] = flags.strip()
    try:
        jax.jit(lambda x: -x, compiler_options=QUICK)(0.0)
    except RuntimeError:
        return False
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
    return True


@contextmanager
def _kept_on_disk() -> Iterator[None]:
    """What is compiled meanwhile is kept in the user's cache folder, unless JAX has one already."""
    own = jax.config.jax_compilation_cache_dir  # pyrefly: ignore[missing-attribute]
    folder = None if own else _folder()
    if folder is None:
        yield
        return
    wanted = {"jax_compilation_cache_dir": str(folder), **KEEP}
    before = {name: getattr(jax.config, name) for name in wanted}
    for name, value in wanted.items():
        jax.config.update(name, value)
    try:
        yield
    finally:
        for name, value in before.items():
            jax.config.update(name, value)
        compilation_cache.reset_cache()  # else JAX would go on with this folder


@cache
def _folder() -> Path | None:
    """Where compiled code is kept; None where nothing can be: that costs seconds, nothing else."""
    try:
        folder = content_hash.cache_folder("jax")
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder  # JAX would warn at every compilation if it could not write there
    except (OSError, RuntimeError):  # RuntimeError: a user without a home
        return None
