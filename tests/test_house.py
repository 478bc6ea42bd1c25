"""How the code is written, as far as a machine can tell."""

import ast
from collections import defaultdict
from pathlib import Path

import planner


def test_no_class_name_occurs_twice():
    """One name, one thing: whoever searches for a class finds it."""
    found: dict[str, list[str]] = defaultdict(list)
    root = Path(planner.__file__).parent
    for path in sorted(root.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                found[node.name].append(str(path.relative_to(root)))
    assert len(found) > 300
    assert {name: paths for name, paths in found.items() if len(paths) > 1} == {}
