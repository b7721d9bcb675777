"""The nodes of the train buses: the medium, and on each train two terminals and the monitor."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

from rail_corridor.equipment.node_spec import NodeSpec
from rail_signals.train_bus.consist import Consist
from rail_signals.train_bus.train import train_consist
from rail_world.train_bus.description import BusDescription, BusFaultDescription, TrainBus

from .fault_section import BusFault
from .section import BusPlan

if TYPE_CHECKING:
    from rail_corridor.scenario.model import Scenario

BUS_MEDIUM: Final = "/world/bus_medium"
#: Kinds of nodes that read the clock.
CLOCKED: Final = ("bus_medium", "bus_terminal", "train_bus_monitor")
#: Beyond the delay as drawn: tolerances, and what dispersion adds.
_DELAY_SHARE: Final = 1.2
_DELAY_MARGIN_S: Final = 2e-6
#: A block larger than shared memory has room for goes slowly or not at all [bytes].
_LARGEST_BLOCK: Final = 400_000
_BYTES_PER_SAMPLE: Final = 16


def bus_trains(scenario: Scenario) -> tuple[str, ...]:
    """Trains that have a bus, in the order of the scenario; none without the section."""
    plan = scenario.train_bus
    if plan is None:
        return ()
    wanted = set(plan.trains) or {train.name for train in scenario.trains}
    return tuple(train.name for train in scenario.trains if train.name in wanted)


def bus_fault_of(scenario: Scenario, train: str) -> BusFault | None:
    """The fault in the bus of a train, None if it stays healthy."""
    faults = [f for f in scenario.faults if isinstance(f, BusFault) and f.train == train]
    return faults[0] if faults else None


def bus_consist(plan: BusPlan) -> Consist:
    """Drawing of the bus."""
    return train_consist(plan.cars)


def place_of_fault(scenario: Scenario, fault: BusFault) -> float:
    """Where a fault begins [m of cable from the head]."""
    assert scenario.train_bus is not None
    starts_m = bus_consist(scenario.train_bus).starts_m
    if fault.car is not None:
        return float(starts_m[fault.car - 1])
    if fault.coupler is not None:
        return float(starts_m[fault.coupler])
    return fault.at_m or 0.0


def bus_description(scenario: Scenario) -> BusDescription | None:
    """What the bus medium knows, None without train buses."""
    plan = scenario.train_bus
    if plan is None:
        return None
    consist = bus_consist(plan)
    ohm = consist.termination.resistance_ohm
    return BusDescription(
        trains=tuple(
            TrainBus(train=name, cars=plan.cars, fault=_fault(bus_fault_of(scenario, name)))
            for name in bus_trains(scenario)
        ),
        bit_rate_hz=plan.bit_rate_hz,
        samples_per_bit=plan.samples_per_bit,
        level_v=plan.level_v,
        noise_v=plan.noise_v,
        source_ohm=ohm,
        longest_delay_s=_longest_delay_s(consist),
        reference_ohm=ohm,
        reflectometer_noise=plan.reflectometer_noise,
    )


def bus_nodes(scenario: Scenario, world_file: str, timeout_s: float) -> list[NodeSpec]:
    """Nodes of the train buses; none without them."""
    plan = scenario.train_bus
    if plan is None:
        return []
    medium = {"world_file": world_file, "timeout_s": 2 * timeout_s / 5}
    nodes = [NodeSpec("bus_medium", BUS_MEDIUM, "world", medium)]
    trains = bus_trains(scenario)
    for number, train in enumerate(trains):
        for end in ("head", "tail"):
            parameters = _terminal(scenario, plan, end, 3 * timeout_s / 5)
            nodes.append(NodeSpec("bus_terminal", f"/{train}/bus_{end}", "onboard", parameters))
        parameters = _monitor(scenario, plan, number / len(trains), 3 * timeout_s / 5)
        name = f"/{train}/train_bus_monitor"
        nodes.append(NodeSpec("train_bus_monitor", name, "onboard", parameters))
    return nodes


def most_traces(plan: BusPlan) -> int:
    """Traces of a measurement that fit into one block."""
    # Loaded where it is wanted: it takes longer than all of a scenario.
    from rail_signals.train_bus.tdr.reflectometer import Reflectometer

    consist = bus_consist(plan)
    rise_s = plan.reflectometer_rise_s
    instrument = Reflectometer(rise_time_s=rise_s, sample_period_s=rise_s / 4.0)
    samples = instrument.samples_for(consist.line().delay_s)
    return _LARGEST_BLOCK // (_BYTES_PER_SAMPLE * samples)


def _longest_delay_s(consist: Consist) -> float:
    return _DELAY_SHARE * consist.line().delay_s + _DELAY_MARGIN_S


def _terminal(scenario: Scenario, plan: BusPlan, end: str, timeout_s: float) -> dict[str, Any]:
    return {
        "end": end,
        "bit_rate_hz": plan.bit_rate_hz,
        "samples_per_bit": plan.samples_per_bit,
        "rise_time_s": plan.rise_time_s,
        "longest_delay_s": _longest_delay_s(bus_consist(plan)),
        "answer_timeout_s": plan.answer_timeout_s,
        "medium": BUS_MEDIUM,
        "tick_s": scenario.tick_s,
        "timeout_s": timeout_s,
    }


def _monitor(scenario: Scenario, plan: BusPlan, share: float, timeout_s: float) -> dict[str, Any]:
    # Trains measure one after the other, not all in one tick.
    ticks = math.floor(share * plan.period_s / scenario.tick_s)
    return {
        "cars": plan.cars,
        "period_s": plan.period_s,
        "offset_s": ticks * scenario.tick_s,
        "traces": min(plan.traces, most_traces(plan)),
        "rise_time_s": plan.reflectometer_rise_s,
        "noise_rms": plan.reflectometer_noise,
        "medium": BUS_MEDIUM,
        "tick_s": scenario.tick_s,
        "timeout_s": timeout_s,
    }


def _fault(fault: BusFault | None) -> BusFaultDescription | None:
    if fault is None:
        return None
    return BusFaultDescription(
        fault=fault.fault,
        from_s=fault.from_s,
        to_s=fault.to_s,
        law=fault.law,
        size=fault.full_size,
        at_m=fault.at_m or 0.0,
        length_m=fault.length_m,
        conductance_us_per_m=fault.conductance_us_per_m,
        car=fault.car or 1,
        coupler=fault.coupler or 1,
        profile=fault.cable if fault.fault == "wrong_cable" else "",
        noise_factor=fault.noise_factor if fault.fault == "missing_shield_ground" else 1.0,
        spread=fault.spread if fault.fault == "loose_connector" else 0.0,
    )
