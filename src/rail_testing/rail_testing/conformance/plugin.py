"""The pytest plug-in of a run: the fixture ``bench``, the marker ``requirement``, the verdicts."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

import pytest

from rail_testing.corridor import Corridor
from rail_testing.plugin import CorridorFactory

from .bench import Bench, Settings
from .kinds import FOLDER
from .results import Results, TestResult

_MARKER = "requirement(clause): clause of a document that the test shows"


class ConformancePlugin:
    """Gives tests their bench, and notes what they show.

    Parameters
    ----------
    settings : Settings
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self.results = Results()
        #: Tests that were found, with their clauses.
        self.found: list[TestResult] = []

    @pytest.fixture
    def bench(self, corridor: CorridorFactory, request: pytest.FixtureRequest) -> Iterator[Bench]:
        """Return the implementation under test; what is started ends with the test."""
        made = Bench(self._settings, self._maker(corridor, request.node.name))
        yield made
        made.close()

    def _maker(self, corridor: CorridorFactory, test: str) -> Callable[..., Corridor]:
        folder = self._settings.record

        def make(scenario: Any, **arguments: Any) -> Corridor:
            if folder is not None:
                name = "".join(each if each.isalnum() else "_" for each in test).strip("_")
                arguments["recording"] = folder / f"{self._settings.kind.name}_{name}.mcap"
            return corridor(scenario, **arguments)

        return make

    def pytest_configure(self, config: pytest.Config) -> None:
        """Tell pytest of the marker."""
        config.addinivalue_line("markers", _MARKER)

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Let the clauses stand in the file of JUnit, and refuse a test that shows none."""
        for item in items:
            clauses = _clauses(item)
            if not clauses:
                raise pytest.UsageError(f"{item.nodeid}: shows no requirement")
            item.user_properties += [("requirement", clause) for clause in clauses]

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Note what will run."""
        self.found = [_noted(item, "not run") for item in session.items]

    @pytest.hookimpl(wrapper=True, tryfirst=True)  # after the recording has been written
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Note a verdict."""
        report = yield
        if report.when == "call" or not report.passed:
            self._note(item, report, call)
        return report

    def _note(
        self, item: pytest.Item, report: pytest.TestReport, call: pytest.CallInfo[None]
    ) -> None:
        verdict = {"passed": "passed", "skipped": "not applicable"}.get(report.outcome, "failed")
        words = ""
        if call.excinfo is not None:
            words = " ".join(str(call.excinfo.value).split())
        noted = _noted(item, verdict, words, report.duration, _recording(report))
        self.results.tests.append(noted)


def _noted(
    item: pytest.Item,
    verdict: str,
    words: str = "",
    seconds: float = 0.0,
    recording: Path | None = None,
) -> TestResult:
    text = inspect.getdoc(getattr(item, "obj", None)) or ""
    file = item.path.relative_to(FOLDER) if item.path.is_relative_to(FOLDER) else item.path
    return TestResult(
        item.name, str(file), text, _clauses(item), verdict, words, seconds, recording
    )


def _clauses(item: pytest.Item) -> tuple[str, ...]:
    markers = list(item.iter_markers("requirement"))
    return tuple(str(clause) for marker in reversed(markers) for clause in marker.args)


def _recording(report: pytest.TestReport) -> Path | None:
    """The recording that the corridor's plug-in has written of a failed test."""
    for title, content in report.sections:
        if title == "corridor":
            for line in content.splitlines():
                if line.startswith("recording: "):
                    return Path(line.removeprefix("recording: "))
    return None
