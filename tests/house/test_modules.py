"""Every module is short and runs on the oldest Python the project supports."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MODULES = sorted([*ROOT.glob("src/*/*/**/*.py"), *ROOT.glob("examples/*/src/**/*.py")])
MOST_LINES = 400


def ids(path: Path) -> str:
    """Return a short name for a module."""
    return str(path.relative_to(ROOT)).removeprefix("src/")


@pytest.mark.parametrize("path", MODULES, ids=ids)
def test_a_module_is_short_and_postpones_annotations(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert text.count("\n") <= MOST_LINES, "one idea per module: split it"
    tree = ast.parse(text, feature_version=(3, 10))
    assert ast.get_docstring(tree), "a module says what it is for"
    if path.name != "__init__.py":
        futures = [n for n in tree.body if isinstance(n, ast.ImportFrom)]
        assert futures[:1], "no imports at all"
        assert futures[0].module == "__future__"


def test_corridor_script_uses_the_standard_library_only() -> None:
    tree = ast.parse((ROOT / "corridor.py").read_text(encoding="utf-8"), feature_version=(3, 10))
    names = {
        name.partition(".")[0]
        for node in ast.walk(tree)
        for name in (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }
    assert names <= set(sys.stdlib_module_names)
