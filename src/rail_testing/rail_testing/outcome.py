"""How a run has ended."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from rail_corridor.report.verdict import Verdict


@dataclass(frozen=True)
class Outcome:
    """A run that has ended.

    Parameters
    ----------
    report : dict
        As ``rail run --report`` writes it.
    verdict : Verdict
        Equals the word ``safe`` or ``unsafe``.
    """

    report: dict[str, Any] = field(repr=False)
    verdict: Verdict

    @property
    def digest(self) -> str:
        """Of everything that equipment has estimated."""
        return str(self.report["digest"])
