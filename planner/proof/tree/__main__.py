"""python -m planner.proof.tree OUT --seed S [--kind NAME]"""

import argparse
import sys
from pathlib import Path

from planner.proof.tree.case import make_case, write_answer, write_case
from planner.proof.tree.deck import KINDS
from planner.proof.tree.sizes import sizes_of


def main(arguments: list[str] | None = None) -> int:
    """Write one case and its sealed answer."""
    parser = argparse.ArgumentParser(prog="planner.proof.tree")
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
