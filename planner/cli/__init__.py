"""The command `planner`."""

import gc
import os
import sys

# Objects made between two searches for garbage in cycles, of which there is next to none: at 700,
# as ever, an import of hits searches 260 times and takes 0.1 s of its 4 s for it.
BETWEEN_COLLECTIONS = 100_000


def main() -> None:
    """Entry point: run one command and leave with its exit code."""
    # Matrices here are small: more BLAS threads cost 5 to 15 times the time (must precede NumPy).
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    gc.set_threshold(BETWEEN_COLLECTIONS)
    from planner.cli.run import run

    sys.exit(run(sys.argv[1:]))
