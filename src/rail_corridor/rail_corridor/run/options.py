"""How a scenario is run, apart from what is in it."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rail_corridor.errors import InputError
from rail_corridor.plan.plan import Part, Placement, Plan
from rail_corridor.recording.topic_selection import EVERY_TOPIC, TopicSelection

from .kills import Kill

#: More processes than this to a core cost more than they show.
MOST_PROCESSES_PER_CORE = 8


@dataclass(frozen=True)
class RecordOptions:
    """What of a run is recorded, and where.

    Parameters
    ----------
    path : Path
        File to write.
    selection : TopicSelection
    split_bytes : int, optional
        A file that has grown to so much is closed and another one begun; one file unless given.
    """

    path: Path
    selection: TopicSelection = EVERY_TOPIC
    split_bytes: int | None = None


@dataclass(frozen=True)
class RunOptions:
    """How to run a scenario, apart from what is in it."""

    rate: float = 0.0
    placement: Placement | None = None
    only: Part | None = None
    report: Path | None = None
    timeout_s: float = 30.0
    external: tuple[str, ...] = ()
    kills: tuple[Kill, ...] = ()
    record: RecordOptions | None = None
    switches: bool = False
    allow_failures: bool = False
    #: Full names of nodes beside the corridor's that each tick waits for.
    attached: tuple[str, ...] = ()
    #: Of a run in one process: is given its nodes and their context before they are spun. The
    #: report is then not printed.
    probe: Callable[[list[Any], Any], None] | None = None

    @property
    def with_external_nodes(self) -> bool:
        """Whether somebody else runs some of the nodes."""
        return bool(self.external or self.attached or self.only)


def check_recording(path: Path, only: str | None) -> None:
    """Raise InputError for a recording that cannot be made."""
    if path.suffix != ".mcap":
        reason = "the name of a recording ends in .mcap"
    elif only == "onboard":
        reason = "record where the world runs, with --only wayside"
    else:
        return
    raise InputError(reason, field="--record", value=str(path))


def default_placement(plan: Plan, cores: int | None = None) -> Placement:
    """A process per site and train, unless they are too many for the cores: then one is faster."""
    most = MOST_PROCESSES_PER_CORE * (cores or os.cpu_count() or 1)
    return "site" if len({spec.site for spec in plan.nodes}) <= most else "one"
