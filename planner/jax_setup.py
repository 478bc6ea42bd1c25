"""JAX as every module here wants it: float64, strict shapes, compiled code kept between runs."""

import os
import tempfile
from functools import partial

# Matrices here are small: threads gain nothing, and on few cores nested parallel LAPACK calls
# wait for each other for ever. NPROC is how XLA learns the size of its thread pool.
os.environ.setdefault("NPROC", "1")
_FLAG = "--xla_cpu_multi_thread_eigen=false"
if _FLAG not in os.environ.get("XLA_FLAGS", ""):
    os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {_FLAG}".strip()

import jax  # noqa: E402  (reads XLA_FLAGS when it starts)

from planner import cache_folder  # noqa: E402

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")

try:
    folder = cache_folder.folder("jax")
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):
        pass  # JAX would warn at every compilation if it could not write there
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
except (OSError, RuntimeError):  # RuntimeError: a user without a home
    pass  # a cache that cannot be kept costs seconds, nothing else

# Less time to compile, and about as fast for many small matrices; wide vectors are a fifth faster.
_WIDE: dict[str, bool | int | str] = {"xla_cpu_prefer_vector_width": "512"}
_QUICK = {"xla_cpu_use_fusion_emitters": False, "xla_backend_optimization_level": 1, **_WIDE}


def _understood(options: dict[str, bool | int | str]) -> bool:
    try:
        jax.jit(lambda x: -x, compiler_options=options)(0.0)
    except RuntimeError:
        return False
    return True


_KNOWN = _understood(_QUICK)  # another XLA may lack the options

# As jax.jit, for what the first fit of a campaign waits for, and for loops that run long.
quickly_compiled = partial(jax.jit, compiler_options=_QUICK if _KNOWN else None)
widely_compiled = partial(jax.jit, compiler_options=_WIDE if _KNOWN else None)
