"""python -m tests.support.foreign_cells OUT --seed S [--kind NAME]"""

import argparse
import sys
from pathlib import Path

from tests.support.foreign_cells.case import make_case, write_answer, write_case
from tests.support.foreign_cells.deck import KINDS
from tests.support.foreign_cells.sizes import sizes_of


def main(arguments: list[str] | None = None) -> int:
    """Write one case and its sealed answer."""
    parser = argparse.ArgumentParser(prog="tests.support.foreign_cells")
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--kind", choices=KINDS)
    options = parser.parse_args(arguments)
    case = make_case(options.seed, options.kind)
    write_case(case, options.out)
    write_answer(case, options.out, sizes_of(case))
    return 0


if __name__ == "__main__":
    sys.exit(main())
