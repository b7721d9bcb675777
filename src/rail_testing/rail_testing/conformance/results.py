"""What the tests have shown: each with its clauses, its verdict, its words and its recording."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class TestResult:
    """One test.

    Parameters
    ----------
    name : str
        Without its module.
    file : str
        Of the test, relative to the folder of all.
    text : str
        What it shows, in a sentence.
    clauses : tuple of str
    verdict : str
        ``passed``, ``failed``, or ``not applicable``.
    words : str
        Why, where it has not passed.
    seconds : float
        Wall time.
    recording : Path, optional
    """

    __test__ = False

    name: str
    file: str
    text: str
    clauses: tuple[str, ...]
    verdict: str
    words: str = ""
    seconds: float = 0.0
    recording: Path | None = None


@dataclass
class Results:
    """All tests of a run, in their order."""

    tests: list[TestResult] = field(default_factory=list)

    def count(self, verdict: str) -> int:
        """How many tests have a verdict."""
        return sum(test.verdict == verdict for test in self.tests)

    @property
    def passed(self) -> bool:
        """Whether some have passed and none has failed."""
        return self.count("passed") > 0 and not self.count("failed")

    def by_clause(self) -> dict[str, list[TestResult]]:
        """Tests that show each clause, in the order of the clauses."""
        clauses = sorted({clause for test in self.tests for clause in test.clauses})
        return {clause: [t for t in self.tests if clause in t.clauses] for clause in clauses}
