"""Whether a run was safe: all figures of its report that must be zero, whatever the equipment."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from rail_corridor.equipment.registry import subsystems


@dataclass(frozen=True, eq=False, repr=False)
class Verdict:
    """What a report says about safety; it equals the word ``safe`` or ``unsafe``.

    Parameters
    ----------
    counters : mapping
        Every figure that must be zero, by its path in the report: ticks, seconds or events.
    """

    counters: Mapping[str, float]

    @property
    def violations(self) -> dict[str, float]:
        """Those that are not zero."""
        return {path: value for path, value in self.counters.items() if value}

    @property
    def safe(self) -> bool:
        """Whether there are none."""
        return not self.violations

    @property
    def word(self) -> Literal["safe", "unsafe"]:
        """``safe`` or ``unsafe``."""
        return "safe" if self.safe else "unsafe"

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Verdict):
            return self.counters == other.counters
        return self.word == other

    def __hash__(self) -> int:
        return hash(self.word)

    def __repr__(self) -> str:
        said = ", ".join(f"{path} {value:g}" for path, value in self.violations.items())
        return f"unsafe: {said}" if said else "safe"


def verdict_of(report: Mapping[str, Any]) -> Verdict:
    """Verdict of a report; figures of equipment that a scenario has not are left out."""
    paths = dict.fromkeys(path for each in subsystems() for path in each.hazards)
    return Verdict(
        {found: float(value or 0.0) for path in paths for found, value in _at(report, path)}
    )


def _at(value: Any, path: str, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Full path and value of everything that a path with ``*`` names."""
    key, _, rest = path.partition(".")
    if not isinstance(value, Mapping):
        return
    for name in (*value,) if key == "*" else (key,):
        if name not in value:
            continue
        full = f"{prefix}{name}"
        if rest:
            yield from _at(value[name], rest, f"{full}.")
        else:
            yield full, value[name]
