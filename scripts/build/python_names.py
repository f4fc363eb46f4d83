"""Checks that no variable, parameter or function in Python has a name that clippy.toml disallows in Rust.

    python scripts/build/python_names.py FILE...

Names that other code sees (attributes of classes, entries of files) are free. Exit status 1: such a name was found.
"""

import ast
import sys
import tomllib
from pathlib import Path

DISALLOWED = set(tomllib.loads(Path("clippy.toml").read_text(encoding="utf-8"))["disallowed-names"])


def names(path):
    """The names that a file binds, with their lines."""
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.id
        elif isinstance(node, ast.arg):
            yield node.lineno, node.arg
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield node.lineno, node.name


lines = [
    f"{path}:{line}: the name `{name}` does not say what it is; use the noun of the thing"
    for path in map(Path, sys.argv[1:])
    for line, name in names(path)
    if name in DISALLOWED
]
print("\n".join(lines))
sys.exit(1 if lines else 0)
