"""The one-way import rule: signals, messages, three peers, the corridor, its test bench."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

SRC = Path(__file__).resolve().parents[2] / "src"
MAY_IMPORT: dict[str, set[str]] = {
    "rail_signals": set(),
    "rail_msgs_py": {"rail_signals"},
    "rail_world": {"rail_signals", "rail_msgs_py"},
    "rail_wayside": {"rail_signals", "rail_msgs_py"},
    "rail_onboard": {"rail_signals", "rail_msgs_py"},
    "rail_corridor": {"rail_signals", "rail_msgs_py", "rail_world", "rail_wayside", "rail_onboard"},
    "rail_testing": {"rail_signals", "rail_msgs_py", "rail_corridor"},
}
SIGNALS_MAY_USE = {"numpy", "scipy", "numba"}
MODULES = sorted(SRC.glob("*/*/**/*.py"))


def imported_packages(source: str, package: str) -> Iterator[tuple[int, str]]:
    """Yield line number and top-level package of every import, wherever it stands."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name.partition(".")[0]
        elif isinstance(node, ast.ImportFrom):
            name = package if node.level else (node.module or "").partition(".")[0]
            yield node.lineno, name
        elif (
            isinstance(node, ast.Call)
            and isinstance(node.func, (ast.Name, ast.Attribute))
            and getattr(node.func, "attr", getattr(node.func, "id", ""))
            in ("import_module", "__import__")
            and node.args
            and isinstance(node.args[0], ast.Constant)
        ):
            yield node.lineno, str(node.args[0].value).partition(".")[0]


def offences(source: str, package: str) -> list[str]:
    """Return what a module of `package` imports and may not."""
    bad = []
    for line, name in imported_packages(source, package):
        ours = name in MAY_IMPORT
        if ours and name != package and name not in MAY_IMPORT[package]:
            bad.append(f"line {line}: {package} may not import {name}")
        elif (
            package == "rail_signals"
            and not ours
            and name not in SIGNALS_MAY_USE
            and name not in sys.stdlib_module_names
        ):
            bad.append(f"line {line}: rail_signals may not import {name}")
    return bad


def test_every_package_has_modules() -> None:
    assert {path.parent.parent.name for path in SRC.glob("*/*/__init__.py")} == set(MAY_IMPORT)


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(SRC)))
def test_module_keeps_the_rule(path: Path) -> None:
    package = path.relative_to(SRC).parts[0]
    if path.name == "setup.py":
        return
    assert offences(path.read_text(encoding="utf-8"), package) == []


@pytest.mark.parametrize(
    ("package", "source", "count"),
    [
        ("rail_signals", "import rclpy", 1),
        ("rail_signals", "import numpy.linalg, math\nfrom scipy import signal", 0),
        ("rail_signals", "def f():\n    from rail_msgs_py import qos", 1),
        ("rail_msgs_py", "from rail_signals.constants import C\nimport rclpy", 0),
        ("rail_wayside", "if True:\n    import rail_world.line.track", 1),
        (
            "rail_onboard",
            "import importlib\nimportlib.import_module('rail_wayside.ranging.wrs_node')",
            1,
        ),
        ("rail_world", "from rail_corridor.scenario.model import Scenario", 1),
        ("rail_world", "from . import track", 0),
        ("rail_corridor", "import rail_world, rail_wayside, rail_onboard, rail_signals", 0),
    ],
)
def test_the_rule_catches_what_it_should(package: str, source: str, count: int) -> None:
    assert len(offences(source, package)) == count
