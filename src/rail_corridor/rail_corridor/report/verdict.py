"""Whether a run was safe and live.

Unsafe is a run in which a figure of its report that must be zero is not, whatever the equipment,
or in which one of the events happened that must not. Not live is one in which a train stood for
too long without a reason, after the last fault had ended.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

from rail_corridor.equipment.registry import subsystems

#: Kinds of events that make a run unsafe.
UNSAFE: Final = (
    "collision",
    "derailment",
    "end of track passed",
    "end of authority passed",
    "occupied block entered",
    "position wrong",
)
#: ... and those by which it is not live.
NOT_LIVE: Final = ("stall", "stuck")

#: Kinds that a report counts, and the keys of their counts.
COUNTED: Final = {kind.replace(" ", "_"): kind for kind in (*UNSAFE, *NOT_LIVE, "entrance")}

Word = Literal["safe", "unsafe", "not live"]


@dataclass(frozen=True, eq=False, repr=False)
class Verdict:
    """What a report says about safety; it equals the word ``safe``, ``unsafe`` or ``not live``.

    Parameters
    ----------
    counters : mapping
        Every figure that must be zero, by its path in the report: ticks, seconds or events.
    happened : tuple of str
        The events that make it unsafe.
    held_up : tuple of str
        Who stood for too long, and what it waited for.
    """

    counters: Mapping[str, float]
    happened: tuple[str, ...] = ()
    held_up: tuple[str, ...] = ()

    @property
    def violations(self) -> dict[str, float]:
        """Those that are not zero."""
        return {path: value for path, value in self.counters.items() if value}

    @property
    def safe(self) -> bool:
        """Whether there are none."""
        return not self.violations

    @property
    def word(self) -> Word:
        """``safe``, ``unsafe`` or ``not live``."""
        if not self.safe:
            return "unsafe"
        return "not live" if self.held_up else "safe"

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why it is not safe and live, what happened first."""
        violations = (
            f"{path} {value:g}"
            for path, value in self.violations.items()
            if not path.startswith("events.")
        )
        return (*self.happened, *violations, *self.held_up)

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Verdict):
            theirs = (other.counters, other.happened, other.held_up)
            return (self.counters, self.happened, self.held_up) == theirs
        return self.word == other

    def __hash__(self) -> int:
        return hash(self.word)

    def __repr__(self) -> str:
        said = ", ".join(self.reasons)
        return f"{self.word}: {said}" if said else self.word


def verdict_of(report: Mapping[str, Any]) -> Verdict:
    """Verdict of a report; figures of equipment that a scenario has not are left out."""
    paths = dict.fromkeys(path for each in subsystems() for path in each.hazards)
    counters = {found: float(value or 0.0) for path in paths for found, value in _at(report, path)}
    grave = [event for event in report.get("events", ()) if event.get("level") == "error"]
    counted = Counter(event["kind"] for event in grave if event.get("kind") in UNSAFE)
    counters |= {f"events.{kind}": float(count) for kind, count in sorted(counted.items())}
    return Verdict(counters, _said(grave, UNSAFE), _said(grave, NOT_LIVE))


def event_counts(events: Iterable[Mapping[str, Any]]) -> dict[str, int]:
    """How many events of each kind there are, those that did not happen too."""
    found = Counter(event.get("kind") for event in events)
    return {key: found[kind] for key, kind in COUNTED.items()}


def _said(events: Iterable[Mapping[str, Any]], kinds: Collection[str]) -> tuple[str, ...]:
    """What happened and when, of events of some kinds."""
    return tuple(
        f"{event['message']} ({event['time_s']:.1f} s)"
        for event in events
        if event.get("kind") in kinds
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
