"""From a scenario to nodes: what runs, with which parameters, in which process."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np

from rail_corridor.equipment.node_spec import NodeSpec, Side
from rail_corridor.equipment.off_times import with_off_times
from rail_corridor.equipment.registry import (
    node_kinds,
    odometer_error_of,
    subsystems,
    supervision_of,
)
from rail_corridor.equipment.subsystem import PlanContext, Supervision
from rail_corridor.errors import InputError, did_you_mean
from rail_corridor.run_data import RecordSpec, RunData, in_one_message
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.world import STATE
from rail_world.world_file import WorldFile

from .world_plan import world_file

Placement = Literal["one", "site", "node"]
#: What one host may run of a corridor.
Part = Literal["wayside", "onboard", "report"]

WORLD: Final = "/world"
#: Full name of the node that reads the run for its report.
REPORT: Final = "/report"
#: Participants of one host that discovery on the local host can bring together, with margin.
MOST_PROCESSES = 26


_FULL_NAME: Final = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_SIDES: Final[dict[Part | None, tuple[Side, ...]]] = {
    None: ("world", "wayside", "onboard"),
    "wayside": ("world", "wayside"),
    "onboard": ("onboard",),
    "report": (),
}


@dataclass(frozen=True)
class Plan:
    """Everything that a run needs, made from a scenario before anything starts."""

    scenario: str
    seed: int
    ticks: int
    tick_s: float
    nodes: tuple[NodeSpec, ...]
    world: WorldFile
    records: tuple[RecordSpec, ...]

    def node(self, name: str) -> NodeSpec:
        """A node by its full name; InputError if there is none."""
        for spec in self.nodes:
            if spec.name == name:
                return spec
        reason = "the corridor has no such node"
        reason += did_you_mean(name, [spec.name for spec in self.nodes])
        raise InputError(reason, field="node", value=name)

    def groups(
        self, placement: Placement, only: Part | None = None, external: Iterable[str] = ()
    ) -> dict[str, list[NodeSpec]]:
        """Nodes by process.

        Parameters
        ----------
        placement : 'one', 'site' or 'node'
        only : 'wayside', 'onboard' or 'report', optional
            Part of the corridor that this host runs; the world is with the wayside, and the report
            is no node of the plan.
        external : iterable of str
            Full names of nodes that somebody else runs; the corridor waits for them.
        """
        others = set(external)
        sides = _SIDES[only]
        nodes = [spec for spec in self.nodes if spec.side in sides]
        nodes = [spec for spec in nodes if spec.name not in others]
        if not nodes:
            return {}
        if placement == "one":
            return {"corridor": nodes}
        groups: dict[str, list[NodeSpec]] = {}
        for spec in nodes:
            key = spec.site if placement == "site" else spec.name.strip("/").replace("/", "_")
            groups.setdefault(key, []).append(spec)
        return _packed(groups)


def check_external(plan: Plan, external: Iterable[str], attached: Iterable[str] = ()) -> None:
    """Raise InputError for a node that cannot be somebody else's, or stand beside the others."""
    _check_attached(plan, attached)
    known = [spec.name for spec in plan.nodes if spec.name != WORLD]
    for name in external:
        if name not in known:
            reason = "the corridor has no such node that could be replaced"
            reason += did_you_mean(name, known)
            raise InputError(reason, field="--external", value=name)


def _check_attached(plan: Plan, attached: Iterable[str]) -> None:
    """Raise InputError for a name that no further node of the corridor can have."""
    for name in attached:
        if not _FULL_NAME.fullmatch(name):
            reason = "must be the full name of a node, as /my/monitor"
        elif name == REPORT or any(spec.name == name for spec in plan.nodes):
            reason = "is a node of the corridor itself; --external replaces one"
        else:
            continue
        raise InputError(reason, field="--attach", value=name)


def _packed(groups: dict[str, list[NodeSpec]]) -> dict[str, list[NodeSpec]]:
    """Neighbouring processes put together until there are few enough to find each other."""
    if len(groups) <= MOST_PROCESSES:
        return groups
    fixed = {name: specs for name, specs in groups.items() if specs[0].side == "world"}
    rest = [(name, specs) for name, specs in groups.items() if name not in fixed]
    parts = np.array_split(np.arange(len(rest)), MOST_PROCESSES - len(fixed))
    for part in parts:
        members = [rest[index] for index in part]
        name = members[0][0] if len(members) == 1 else f"{members[0][0]}-{members[-1][0]}"
        fixed[name] = [spec for _, specs in members for spec in specs]
    return fixed


def make_plan(
    scenario: Scenario,
    run_directory: Path,
    *,
    rate: float = 0.0,
    observed: bool = True,
    timeout_s: float = 30.0,
    external: Iterable[str] = (),
    attached: Iterable[str] = (),
    observers: Iterable[str] = (),
) -> Plan:
    """Plan a run; writes the world file into ``run_directory``.

    The world waits for the nodes of the plan, and for ``attached`` ones and ``observers``, which
    are not in it; each tick also for the attached ones to be done.
    """
    attached = tuple(attached)
    world = world_file(scenario)
    world_path = run_directory / "world.json"
    world_path.write_text(world.model_dump_json())
    context = PlanContext(str(world_path), timeout_s, subsystems())
    planned = [spec for each in subsystems() for spec in each.plan(scenario, context)]
    nodes = with_off_times(scenario, planned)
    kinds = node_kinds()
    clocked = {spec.name for spec in nodes if kinds[spec.kind].clocked}
    supervision = supervision_of(scenario)
    trains = tuple(train.name for train in scenario.trains)
    parameters = {
        "world_file": str(world_path),
        "ticks": scenario.ticks,
        "rate": float(rate),
        "nodes": (*(spec.name for spec in nodes), *attached, *observers),
        "sinks": (*(spec.name for spec in nodes if kinds[spec.kind].sink), *attached),
        "clock_readers": len(clocked - {*external}),
        "supervised": trains if supervision else (),
        "odometers": () if odometer_error_of(scenario) is None else trains,
        "supervision": supervision.node if supervision else "",
        "cab_signals": supervision is None or supervision.cab_signals,
        "queue_m": supervision.queue_m if supervision else Supervision.queue_m,
        "observed": observed,
        "end_when_arrived": scenario.end_when_arrived,
        "timeout_s": timeout_s,
        "start_timeout_s": 2.0 * timeout_s,
    }
    return Plan(
        scenario.name,
        scenario.seed,
        scenario.ticks,
        scenario.tick_s,
        (NodeSpec("world", WORLD, "world", parameters), *nodes),
        world,
        records_of(scenario),
    )


def records_of(scenario: Scenario) -> tuple[RecordSpec, ...]:
    """What the report reads: the truth, and what all equipment has to say."""
    names = [train.name for train in scenario.trains]
    truth = RecordSpec(STATE, in_one_message(names), estimated=False)
    return (truth, *(spec for each in subsystems() for spec in each.records(scenario)))


def run_data_of(scenario: Scenario) -> RunData:
    """Where the report of a run is gathered, still empty."""
    names = tuple(train.name for train in scenario.trains)
    return RunData(names, tuple(scenario.tracks), STATE, records_of(scenario))
