"""The command `planner`."""

import os
import sys


def main() -> None:
    """Entry point: run one command and leave with its exit code."""
    # Matrices here are small: more BLAS threads cost 5 to 15 times the time (must precede NumPy).
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    from planner.cli.run import run

    sys.exit(run(sys.argv[1:]))
