"""Which equipment a scenario switches off, and when."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.equipment.registry import node_kinds, subsystems
from rail_corridor.equipment.subsystem import PlanContext
from rail_corridor.errors import InputError, did_you_mean
from rail_corridor.scenario.faults import EquipmentOffFault
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.tick_node import EquipmentNode

_NO_EQUIPMENT = ("/world", "/report")
#: Plans ask for one; none of it is in what is asked here.
_NO_CONTEXT = ("", 30.0)


def off_times(scenario: Scenario) -> dict[str, list[tuple[float, float]]]:
    """Start and end [s] of the times that each node is switched off for, in order and apart.

    Off times that overlap or touch are merged.
    """
    faults = [fault for fault in scenario.faults if isinstance(fault, EquipmentOffFault)]
    merged: dict[str, list[tuple[float, float]]] = {}
    for fault in sorted(faults, key=lambda fault: fault.from_s):
        times = merged.setdefault(fault.node, [])
        if times and fault.from_s <= times[-1][1]:
            from_s, to_s = times.pop()
            times.append((from_s, max(to_s, fault.to_s)))
        else:
            times.append((fault.from_s, fault.to_s))
    return merged


def with_off_times(scenario: Scenario, nodes: Iterable[NodeSpec]) -> list[NodeSpec]:
    """Nodes with the off times of each among its parameters."""
    times = off_times(scenario)
    return [
        replace(spec, parameters=spec.parameters | _parameters(times[spec.name]))
        if spec.name in times
        else spec
        for spec in nodes
    ]


def _parameters(times: Sequence[tuple[float, float]]) -> dict[str, tuple[float, ...]]:
    return {
        "off_from_s": tuple(from_s for from_s, _ in times),
        "off_to_s": tuple(to_s for _, to_s in times),
    }


def check_off_times(scenario: Scenario) -> None:
    """Raise InputError for the first equipment_off whose node cannot be switched off."""
    places = [n for n, fault in enumerate(scenario.faults) if isinstance(fault, EquipmentOffFault)]
    if not places:
        return
    context = PlanContext(*_NO_CONTEXT, subsystems())
    specs = {s.name: s for each in subsystems() for s in each.plan(scenario, context)}
    for place in places:
        fault = scenario.faults[place]
        assert isinstance(fault, EquipmentOffFault)
        name = fault.node
        if name in _NO_EQUIPMENT:
            reason = "is no equipment that could be switched off"
        elif name not in specs:
            reason = f"the corridor has no such node{did_you_mean(name, specs)}"
        elif not issubclass(node_kinds()[specs[name].kind].load(), EquipmentNode):
            reason = f"a {specs[name].kind} cannot be switched off"
        else:
            continue
        raise InputError(reason, field=f"faults.{place}.node", value=name)
