"""What a recording says of its run beside the messages: named values at its beginning and end."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from rail_corridor.errors import InputError

from .topic_selection import EVERY_TOPIC, TopicSelection

#: Names of the two records.
BEGIN: Final = "rail_corridor.begin"
END: Final = "rail_corridor.end"


@dataclass(frozen=True)
class RunStart:
    """Known before the first tick; a recording cut short has it."""

    scenario: str
    seed: int
    nodes: int
    processes: int
    selection: TopicSelection = EVERY_TOPIC

    def values(self) -> dict[str, str]:
        """As values of a record."""
        facts = {key: str(value) for key, value in vars(self).items() if key != "selection"}
        return facts | self.selection.values()

    @classmethod
    def of(cls, values: Mapping[str, str]) -> RunStart:
        """Inverse of `values`; raises InputError."""
        numbers = {key: _count(values, key, BEGIN) for key in ("seed", "nodes", "processes")}
        selection = TopicSelection.of(values)
        return cls(values.get("scenario", ""), **numbers, selection=selection)


@dataclass(frozen=True)
class RunEnd:
    """Known when the run has ended: whether at its own end, after how many ticks and how long.

    The wall time is what no message tells; None if no tick was heard.
    """

    complete: bool
    ticks: int
    wall_time_s: float | None

    def values(self) -> dict[str, str]:
        """As values of a record."""
        wall = {} if self.wall_time_s is None else {"wall_time_s": repr(self.wall_time_s)}
        return {"complete": str(self.complete).lower(), "ticks": str(self.ticks), **wall}

    @classmethod
    def of(cls, values: Mapping[str, str]) -> RunEnd:
        """Inverse of `values`; raises InputError."""
        if values.get("complete") not in ("true", "false"):
            raise InputError(
                "must be true or false", field=f"{END}.complete", value=values.get("complete")
            )
        wall_s: float | None = None
        if "wall_time_s" in values:
            try:
                wall_s = float(values["wall_time_s"])
            except ValueError:
                wall_s = math.nan
            if not 0.0 <= wall_s < math.inf:
                raise InputError(
                    "must be a time", field=f"{END}.wall_time_s", value=values["wall_time_s"]
                )
        return cls(values["complete"] == "true", _count(values, "ticks", END), wall_s)


def _count(values: Mapping[str, str], key: str, record: str) -> int:
    text = values.get(key, "")
    if not (text.isascii() and text.isdecimal() and len(text) < 20):
        raise InputError("must be a whole number", field=f"{record}.{key}", value=text)
    return int(text)
