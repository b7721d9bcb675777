"""What the train bus must agree on with the rest of a scenario."""

from __future__ import annotations

import numpy as np

from rail_corridor.errors import InputError
from rail_corridor.scenario.model import Scenario
from rail_onboard.train_bus.message import PAYLOAD_BYTES
from rail_signals.train_bus.frame import BusFrameFormat
from rail_signals.train_bus.profile import bus_profile_names
from rail_signals.train_bus.train import train_consist

from .nodes import most_traces
from .section import TRAIN_BUS_SECTION, BusFault, BusPlan, TrainPartedFault
from .world import bus_trains


def check_bus(scenario: Scenario) -> None:
    """Raise InputError for the first thing that does not fit the train bus."""
    plan = TRAIN_BUS_SECTION.of(scenario)
    faults = [
        (i, f) for i, f in enumerate(scenario.faults) if isinstance(f, BusFault | TrainPartedFault)
    ]
    if plan is None:
        for index, fault in faults:
            raise InputError(
                "goes with train_bus, of which there is none",
                field=f"faults.{index}.kind",
                value=fault.kind,
            )
        return
    names = [train.name for train in scenario.trains]
    for index, name in enumerate(plan.trains):
        if name not in names:
            raise InputError(
                f"there is no such train, they are {', '.join(names)}",
                field=f"train_bus.trains.{index}",
                value=name,
            )
    for index, car in enumerate(plan.cars):
        _check_profile(f"train_bus.cars.{index}", car)
    _check_frames(scenario, plan)
    seen: set[str] = set()
    for index, fault in faults:
        _check_train(scenario, fault.train, f"faults.{index}")
        if isinstance(fault, BusFault):
            _check_fault(plan, fault, f"faults.{index}")
        elif fault.behind_car >= len(plan.cars):
            raise InputError(
                f"is the last: the train has {len(plan.cars)} cars",
                field=f"faults.{index}.behind_car",
                value=fault.behind_car,
            )
        if fault.train in seen:
            raise InputError(
                "its bus has another fault already",
                field=f"faults.{index}.train",
                value=fault.train,
            )
        seen.add(fault.train)


def _check_profile(field: str, name: str) -> None:
    known = bus_profile_names()
    if name.lower() not in known:
        raise InputError(f"must be one of {', '.join(known)}", field=field, value=name)


def _check_frames(scenario: Scenario, plan: BusPlan) -> None:
    frame = BusFrameFormat(PAYLOAD_BYTES, plan.bit_rate_hz, plan.samples_per_bit, plan.rise_time_s)
    # Both ends speak in a tick, and between them the reflectometer has its turn.
    if 3.0 * frame.duration_s > scenario.tick_s:
        raise InputError(
            f"a frame lasts {frame.duration_s:g} s, a third of a tick is"
            f" {scenario.tick_s / 3.0:g} s",
            field="train_bus.bit_rate_hz",
            value=plan.bit_rate_hz,
        )
    if plan.period_s < scenario.tick_s:
        raise InputError(
            f"is shorter than a tick of {scenario.tick_s:g} s",
            field="train_bus.period_s",
            value=plan.period_s,
        )
    if most_traces(plan) < 1:
        raise InputError(
            "makes a trace of this train too long for one block",
            field="train_bus.reflectometer_rise_s",
            value=plan.reflectometer_rise_s,
        )


def _check_train(scenario: Scenario, train: str, field: str) -> None:
    trains = bus_trains(scenario)
    if train not in trains:
        raise InputError(
            f"no such train has a bus, these have: {', '.join(trains)}",
            field=f"{field}.train",
            value=train,
        )


def _check_fault(plan: BusPlan, fault: BusFault, field: str) -> None:
    consist, cars = train_consist(plan.cars), len(plan.cars)
    if fault.car is not None and fault.car > cars:
        raise InputError(f"the train has {cars} cars", field=f"{field}.car", value=fault.car)
    if fault.coupler is not None and fault.coupler >= cars:
        raise InputError(
            f"the train has {cars - 1} couplers", field=f"{field}.coupler", value=fault.coupler
        )
    if fault.fault == "wrong_cable":
        _check_profile(f"{field}.cable", fault.cable)
    if fault.at_m is None:
        return
    if not 0.0 < fault.at_m < consist.length_m:
        raise InputError(
            f"is not inside the cable, which is {consist.length_m:g} m long",
            field=f"{field}.at_m",
            value=fault.at_m,
        )
    if fault.fault == "water_ingress":
        starts_m = consist.starts_m
        end_m = float(starts_m[np.searchsorted(starts_m, fault.at_m, side="right")])
        if fault.at_m + fault.length_m > end_m:
            raise InputError(
                f"what is wet must lie in one car, whose cable ends at {end_m:g} m",
                field=f"{field}.length_m",
                value=fault.length_m,
            )
