"""What Doppler positioning must agree on with the rest of a scenario."""

from __future__ import annotations

from collections.abc import Sequence

from rail_corridor.equipment.one_way import check_one_way
from rail_corridor.errors import InputError
from rail_corridor.scenario.model import Scenario

from .placement import references_of
from .section import REFERENCES, DeadReference, DetunedReference


def check_doppler(scenario: Scenario, train_fields: Sequence[str]) -> None:
    """Raise InputError for the first thing that does not fit Doppler positioning."""
    _check_faults(scenario)
    plan = REFERENCES.of(scenario)
    if plan is None:
        return
    check_one_way(scenario, train_fields, REFERENCES.name)
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
    stations = {station.name for station in references_of(scenario)}
    for index, fault in enumerate(scenario.faults):
        if isinstance(fault, DeadReference | DetunedReference) and fault.station not in stations:
            raise InputError(
                "there is no such reference station",
                field=f"faults.{index}.station",
                value=fault.station,
            )
