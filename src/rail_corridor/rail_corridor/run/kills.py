"""Equipment that is killed during a run: ``rail run ... --kill NODE@SECONDS``.

A node that has a process of its own, or shares one with its site, goes with that process, by
SIGKILL. One that lives in the process of the launcher is taken out of it: it hears and says
nothing any more. Either way the launcher tells the corridor, as it does of every dead process.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.errors import InputError, did_you_mean

_OPTION = "--kill"


@dataclass(frozen=True)
class Kill:
    """A node by its full name, and the simulated time of its end [s]."""

    node: str
    time_s: float


def parse_kill(text: str) -> Kill:
    """Kill from the command line.

    Raises
    ------
    InputError
        If the text is not NODE@SECONDS.

    Examples
    --------
    >>> parse_kill("/wayside/zone_controller@12.5")
    Kill(node='/wayside/zone_controller', time_s=12.5)
    """
    node, at, seconds = text.rpartition("@")
    try:
        time_s = float(seconds)
    except ValueError:
        time_s = math.nan
    if not (at and node and math.isfinite(time_s) and 0.0 <= time_s <= 1e6):
        reason = "must be NODE@SECONDS, with a time from 0 to 1e6 s"
        raise InputError(reason, field=_OPTION, value=text)
    return Kill(node, time_s)


def check_kills(
    kills: Iterable[Kill], groups: Mapping[str, Sequence[NodeSpec]], world: str, *, one: bool
) -> None:
    """Refuse what cannot be killed.

    Parameters
    ----------
    kills : iterable of Kill
    groups : mapping
        Nodes by process, of this host.
    world : str
        Name of the node without which nothing goes on.
    one : bool
        Whether all run in the process of the launcher, where each can be killed alone.

    Raises
    ------
    InputError
        For a node that does not run here, for the world, and for what dies with the world.
    """
    process = {spec.name: name for name, specs in groups.items() for spec in specs}
    for kill in kills:
        if kill.node not in process:
            known = [name for name in process if name != world]
            reason = f"no such node runs here{did_you_mean(kill.node, known)}"
        elif kill.node == world:
            reason = "nothing goes on without the world"
        elif not one and process[kill.node] == process.get(world):
            reason = "shares a process with the world; use --processes one or node"
        else:
            continue
        raise InputError(reason, field=_OPTION, value=kill.node)


def killed_nodes(kills: Iterable[Kill], processes: Iterable[Sequence[NodeSpec]]) -> set[str]:
    """Full names of what goes with kills: also what shares a process of its own with it."""
    killed = {kill.node for kill in kills}
    groups = [{spec.name for spec in specs} for specs in processes]
    return killed.union(*(names for names in groups if names & killed))


def unplanned_failures(
    failures: Iterable[Mapping[str, Any]],
    kills: Iterable[Kill],
    processes: Iterable[Sequence[NodeSpec]],
) -> list[str]:
    """Full names of nodes that failed and were not meant to."""
    killed = killed_nodes(kills, processes)
    return [one["node"] for one in failures if one["node"] not in killed]


class FaultInjector:
    """Kills what is due.

    Parameters
    ----------
    kills : iterable of Kill
    kill : callable of the full name of a node
        Carries it out.
    """

    def __init__(self, kills: Iterable[Kill], kill: Callable[[str], None]) -> None:
        self._due = sorted(kills, key=lambda one: one.time_s)
        self._kill = kill

    def tick(self, stamp_ns: int) -> None:
        """Take the time of a tick [ns]; kill in the first one that is not before the due time."""
        while self._due and self._due[0].time_s * 1e9 <= stamp_ns:
            self._kill(self._due.pop(0).node)
