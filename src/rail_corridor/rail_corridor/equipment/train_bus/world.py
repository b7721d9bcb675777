"""The buses of the trains as the world has them, and the faults that grow in them."""

from __future__ import annotations

from typing import Final

from rail_corridor.scenario.model import Scenario
from rail_signals.train_bus.consist import Consist
from rail_signals.train_bus.train import train_consist
from rail_world.train_bus.description import BusDescription, BusFaultDescription, TrainBus

from .section import TRAIN_BUS_SECTION, BusFault, BusPlan, TrainPartedFault

#: Beyond the delay as drawn: tolerances, and what dispersion adds.
_DELAY_FRACTION: Final = 1.2
_DELAY_MARGIN_S: Final = 2e-6


def bus_trains(scenario: Scenario) -> tuple[str, ...]:
    """Trains that have a bus, in the order of the scenario; none without the section."""
    plan = TRAIN_BUS_SECTION.of(scenario)
    if plan is None:
        return ()
    wanted = set(plan.trains) or {train.name for train in scenario.trains}
    return tuple(train.name for train in scenario.trains if train.name in wanted)


def bus_fault_of(scenario: Scenario, train: str) -> BusFault | None:
    """The fault in the bus of a train, None if it stays healthy."""
    for fault in scenario.faults:
        if isinstance(fault, BusFault | TrainPartedFault) and fault.train == train:
            return fault if isinstance(fault, BusFault) else cut_of(scenario, fault)
    return None


def cut_of(scenario: Scenario, fault: TrainPartedFault) -> BusFault:
    """The cut through the bus where a train parts."""
    plan = TRAIN_BUS_SECTION.of(scenario)
    assert plan is not None
    return BusFault(
        kind="bus_fault",
        train=fault.train,
        fault="open",
        from_s=fault.from_s,
        to_s=fault.from_s + 1.0,
        at_m=float(bus_consist(plan).starts_m[fault.behind_car]),
    )


def bus_consist(plan: BusPlan) -> Consist:
    """Drawing of the bus."""
    return train_consist(plan.cars)


def place_of_fault(scenario: Scenario, fault: BusFault) -> float:
    """Where a fault begins [m of cable from the head]."""
    plan = TRAIN_BUS_SECTION.of(scenario)
    assert plan is not None
    starts_m = bus_consist(plan).starts_m
    if fault.car is not None:
        return float(starts_m[fault.car - 1])
    if fault.coupler is not None:
        return float(starts_m[fault.coupler])
    return fault.at_m or 0.0


def bus_description(scenario: Scenario) -> BusDescription | None:
    """What the bus medium knows, None without train buses."""
    plan = TRAIN_BUS_SECTION.of(scenario)
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
        longest_delay_s=longest_delay_s(consist),
        reference_ohm=ohm,
        reflectometer_noise=plan.reflectometer_noise,
    )


def longest_delay_s(consist: Consist) -> float:
    """Longest delay of a frame that receivers look for [s]."""
    return _DELAY_FRACTION * consist.bus_line().delay_s + _DELAY_MARGIN_S


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
