"""What positioning on board must agree on with the rest of a scenario."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rail_corridor.errors import InputError
from rail_corridor.scenario.fault_sections import DeadReference, DetunedReference, WheelSlip

if TYPE_CHECKING:
    from rail_corridor.scenario.model import Scenario


def check_positioning(scenario: Scenario, train_fields: Sequence[str]) -> None:
    """Raise InputError for the first thing that does not fit positioning on board."""
    _check_faults(scenario)
    plan = scenario.references
    if plan is None and scenario.localizer is None:
        return
    section = "references" if plan is not None else "localizer"
    for train, field in zip(scenario.trains, train_fields, strict=True):
        for name, several in (("route", len(train.route) > 1), ("reverse_at", train.reverse_at)):
            if several:
                raise InputError(
                    f"{section} goes with trains that run on one track, one way only",
                    field=f"{field}.{name}",
                    value=len(getattr(train, name)),
                )
    if plan is None:
        return
    if plan.tones.duration_s > scenario.tick_s:
        raise InputError(
            f"last {plan.tones.duration_s:g} s, longer than a tick of {scenario.tick_s:g} s",
            field="references.samples",
            value=plan.samples,
        )
    for slot in range(plan.slots):
        cycles = plan.tones.slot_offset_hz(slot) * scenario.tick_s
        if abs(cycles - round(cycles)) > 1e-6:
            raise InputError(
                f"puts tones where a tick of {scenario.tick_s:g} s is no whole number of periods",
                field="references.slot_spacing_hz",
                value=plan.slot_spacing_hz,
            )
    fastest_kmh = max(train.vehicle.max_speed_kmh for train in scenario.trains)
    if fastest_kmh > plan.fastest_kmh:
        raise InputError(
            f"is below the {fastest_kmh:g} km/h of a train",
            field="references.fastest_kmh",
            value=plan.fastest_kmh,
        )


def _check_faults(scenario: Scenario) -> None:
    stations = {station.name for station in scenario.reference_stations}
    trains = {train.name for train in scenario.trains}
    for index, fault in enumerate(scenario.faults):
        if isinstance(fault, DeadReference | DetunedReference) and fault.station not in stations:
            raise InputError(
                "there is no such reference station",
                field=f"faults.{index}.station",
                value=fault.station,
            )
        if isinstance(fault, WheelSlip) and fault.train not in trains:
            raise InputError(
                "there is no such train", field=f"faults.{index}.train", value=fault.train
            )
