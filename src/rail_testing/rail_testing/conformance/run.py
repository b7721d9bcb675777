"""A run of the tests of one kind, with pytest, in this process."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from rail_corridor.errors import InputError
from rail_corridor.stepped.corridor import StalledError
from rail_testing.corridor import Corridor
from rail_testing.under_test import NodeError

from .bench import Bench, Settings
from .kinds import SHARED, folder_of
from .plugin import ConformancePlugin
from .results import Results, TestResult

#: Wall time within which a command must be ready before anything is tested [s].
_READY_S = 15.0


def check_command(settings: Settings) -> None:
    """Start the command once, to see that it can be.

    Raises
    ------
    InputError
        If there is no such program, it ends of itself, or does not say that it is ready.
    """
    if not settings.command:
        return
    program = settings.command[0]
    if shutil.which(program) is None:
        raise InputError("there is no such program", field="--command", value=program)
    made: list[Corridor] = []

    def make(scenario: Any, **arguments: Any) -> Corridor:
        made.append(Corridor(scenario, **arguments))
        return made[-1]

    bench = Bench(settings, make)
    try:
        bench.start(timeout_s=_READY_S)
    except (NodeError, StalledError) as error:
        value = " ".join(settings.command)
        raise InputError(f"cannot be tested: {error}", field="--command", value=value) from None
    finally:
        for each in made:
            each.close()
        bench.close()


def check_scenario(settings: Settings) -> None:
    """See that a scenario has the kind; InputError if not."""
    corridor = Corridor(settings.scenario or dict(settings.kind.scenario), seed=settings.seed)
    if not any(spec.kind == settings.kind.node_kind for spec in corridor.planned.nodes):
        reason = f"has no {settings.kind.title}"
        raise InputError(reason, field="--scenario", value=corridor.scenario.name)


def run_tests(
    settings: Settings, *, keyword: str = "", junit: Path | None = None, quiet: bool = False
) -> Results:
    """Run the tests; an empty result if the expression selects none.

    Raises
    ------
    InputError
        If pytest does not take the expression.
    """
    plugin = ConformancePlugin(settings)
    options = [f"--junit-xml={junit}"] if junit is not None else []
    code = _pytest(plugin, settings, keyword, [*options, "-qq" if quiet else "-q"])
    _check(code, keyword)
    return plugin.results


def list_tests(settings: Settings, keyword: str = "") -> list[TestResult]:
    """What there is to run."""
    plugin = ConformancePlugin(settings)
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        code = _pytest(plugin, settings, keyword, ["--collect-only", "-q"])
    _check(code, keyword)
    return plugin.found


def _pytest(
    plugin: ConformancePlugin, settings: Settings, keyword: str, options: Sequence[str]
) -> int:
    folder = folder_of(settings.kind)
    arguments = [
        *(str(SHARED), str(folder)),
        *("-c", os.devnull, "--rootdir", str(folder.parent)),
        *("--import-mode=importlib", "-p", "no:cacheprovider", "--tb=short"),
        *(["-k", keyword] if keyword else []),
        *options,
    ]
    return int(pytest.main(arguments, plugins=[plugin]))


def _check(code: int, keyword: str) -> None:
    if code == pytest.ExitCode.NO_TESTS_COLLECTED:
        raise InputError("selects no test", field="-k", value=keyword)
    if code == pytest.ExitCode.INTERRUPTED:
        raise KeyboardInterrupt
    if code not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
        raise InputError("is no expression of pytest", field="-k", value=keyword)
