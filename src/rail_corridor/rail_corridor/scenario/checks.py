"""What several sections of a scenario must agree on; the first disagreement is reported."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from rail_corridor.equipment.doppler.checks import check_positioning
from rail_corridor.equipment.ranging.layout import Layout
from rail_corridor.equipment.track_code.checks import check_codes
from rail_corridor.equipment.train_bus.checks import check_bus
from rail_corridor.equipment.train_radio.checks import check_cbtc
from rail_corridor.errors import InputError, from_world
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_world.errors import WorldDataError
from rail_world.line.description import TrainDescription
from rail_world.trains.motion import TrainMotion

from .fault_sections import DeadStation, Jam
from .sections import LONGEST_ZONE_M, StationPlan
from .timetable import CLEARING_TIME_S

if TYPE_CHECKING:
    from .model import Scenario

LARGEST_OFFSET_HZ: Final = 5e3
"""Carrier offset that receivers search by default [Hz]."""
_OSCILLATOR_SIGMAS: Final = 3.0
_WHERE_STATIONS: Final = "stations.positions"


def check_scenario(scenario: Scenario, train_fields: Sequence[str]) -> None:
    """Raise InputError, without a file, for the first thing that does not fit together.

    Parameters
    ----------
    scenario : Scenario
        The scenario; its network and layout are made on the way.
    train_fields : sequence of str
        For each train the path of its fields in the file.
    """
    try:
        network = scenario.network
    except WorldDataError as error:
        raise from_world(error) from None
    layout = scenario.layout
    _check_zone_lengths(scenario, layout)
    _check_channels(scenario, layout)
    _check_band(scenario)
    if not scenario.trains:
        raise InputError("at least one train is needed", field="trains", value=())
    names: set[str] = set()
    for train, field in zip(scenario.trains, train_fields, strict=True):
        if train.name in names:
            raise InputError("another train has it", field=f"{field}.name", value=train.name)
        names.add(train.name)
        try:
            TrainMotion(train, network, scenario.tick_s)
        except WorldDataError as error:
            found = from_world(error)
            place = found.field.removeprefix(f"trains.{train.name}.")
            raise InputError(
                found.reason, field=f"{field}.{place}", value=found.value, file=found.file
            ) from None
    _check_places_of_trains(scenario.trains, train_fields)
    _check_first_zones(scenario, layout, train_fields)
    _check_faults(scenario, layout)
    check_codes(scenario, train_fields)
    check_cbtc(scenario, train_fields)
    check_positioning(scenario, train_fields)
    check_bus(scenario)


def _check_zone_lengths(scenario: Scenario, layout: Layout) -> None:
    plan, ranging = scenario.stations, scenario.ranging
    limit_m = min(ranging.unambiguous_range_m, LONGEST_ZONE_M)
    for zone in layout.zones:
        slant_m = math.hypot(zone.length_m, plan.mast_offset_m, plan.mast_height_m)
        if slant_m > limit_m:
            raise InputError(
                f"{zone.name} on {zone.track} reaches {slant_m:.2f} m from {zone.station}, but"
                f" comparator {ranging.comparator} is unambiguous up to {limit_m:.2f} m",
                field=_zone_field(plan),
                value=plan.zone_length_m if plan.positions is None else zone.station,
            )


def _zone_field(plan: StationPlan) -> str:
    return "stations.zone_length_m" if plan.positions is None else _WHERE_STATIONS


def _check_channels(scenario: Scenario, layout: Layout) -> None:
    """See that zones that meet, or share a station, share no channel."""
    plan = scenario.channels
    groups = [(zone.name, *zone.next) for zone in layout.zones if zone.next]
    groups += [station.zones for station in layout.stations if len(station.zones) > 1]
    for group in groups:
        used: dict[int, str] = {}
        for zone in (layout.zone(name) for name in group):
            for channel in (zone.downlink_channel, zone.uplink_channel):
                if channel in used:
                    on_main = any(channel in pair for pair in plan.main)
                    raise InputError(
                        f"channel {channel} would be used by {used[channel]} and {zone.name},"
                        " which meet",
                        field="channels.main" if on_main else "channels.branch",
                        value=[list(pair) for pair in (plan.main if on_main else plan.branch)],
                    )
                used[channel] = zone.name


def _check_band(scenario: Scenario) -> None:
    """See that the signal fits into its channel, and the carrier into the receivers' search."""
    signal, plan = scenario.ranging.signal, scenario.channels
    carson_hz = 2.0 * (sum(signal.deviations_hz) + max(signal.tones_hz))
    if plan.spacing_hz < carson_hz:
        raise InputError(
            f"is less than the {carson_hz:g} Hz that the ranging signal takes up (Carson's rule)",
            field="channels.spacing_hz",
            value=plan.spacing_hz,
        )
    highest_hz = max(plan.carriers_hz.values())
    fastest_mps = max((t.vehicle.max_speed_kmh for t in scenario.trains), default=0.0) / 3.6
    relative = math.sqrt(2.0) * _OSCILLATOR_SIGMAS * scenario.radio.oscillator_ppm * 1e-6
    offset_hz = highest_hz * (relative + fastest_mps / SPEED_OF_LIGHT_M_PER_S)
    if offset_hz > LARGEST_OFFSET_HZ:
        raise InputError(
            f"with Doppler shift, carriers of {highest_hz:g} Hz would be off by up to"
            f" {offset_hz:.0f} Hz, receivers search {LARGEST_OFFSET_HZ:.0f} Hz",
            field="radio.oscillator_ppm",
            value=scenario.radio.oscillator_ppm,
        )


def _check_places_of_trains(trains: Sequence[TrainDescription], fields: Sequence[str]) -> None:
    """See that no two trains are in one place, before or just after they depart from it."""
    for index, train in enumerate(trains):
        for other in trains[:index]:
            if train.route[0] != other.route[0]:
                continue
            (rear, front), (other_rear, other_front) = _extent(train), _extent(other)
            if rear >= other_front or other_rear >= front:
                continue
            (since, until), (other_since, other_until) = _presence(train), _presence(other)
            if since < other_until and other_since < until:
                raise InputError(
                    f"{other.name} is in the same place within {CLEARING_TIME_S:g} s of departure",
                    field=f"{fields[index]}.start_m",
                    value=train.start_m,
                )


def _check_first_zones(scenario: Scenario, layout: Layout, fields: Sequence[str]) -> None:
    """No two trains may stand in one zone at the start: nothing could ever tell which is which."""
    owners: dict[str, TrainDescription] = {}
    for train, field in zip(scenario.trains, fields, strict=True):
        if train.enters_at_departure:
            continue
        zone = layout.zone_at(train.route[0], train.start_m).name
        if zone in owners:
            raise InputError(
                f"in {zone} like {owners[zone].name}: two trains that start in one zone cannot"
                " be told apart",
                field=f"{field}.start_m",
                value=train.start_m,
            )
        owners[zone] = train


def _presence(train: TrainDescription) -> tuple[float, float]:
    """Time for which a train takes up the place it starts from [s]."""
    since_s = train.depart_s if train.enters_at_departure else 0.0
    return since_s, train.depart_s + CLEARING_TIME_S


def _extent(train: TrainDescription) -> tuple[float, float]:
    rear_m = train.start_m - train.direction * train.vehicle.length_m
    return min(rear_m, train.start_m), max(rear_m, train.start_m)


def _check_faults(scenario: Scenario, layout: Layout) -> None:
    stations = {station.name for station in layout.stations}
    for index, fault in enumerate(scenario.faults):
        field = f"faults.{index}"
        if isinstance(fault, DeadStation):
            if fault.station not in stations:
                raise InputError(
                    f"there is no such station, they are {_some(layout)}",
                    field=f"{field}.station",
                    value=fault.station,
                )
            continue
        if not isinstance(fault, Jam):
            continue
        if fault.channel not in scenario.channels.numbers:
            raise InputError(
                "no zone uses this channel", field=f"{field}.channel", value=fault.channel
            )
        track = scenario.network.tracks.get(fault.track)
        if track is None:
            raise InputError("there is no such track", field=f"{field}.track", value=fault.track)
        if fault.at_m > track.length_m:
            raise InputError(
                f"is off {fault.track}, which ends at {track.length_m:g} m",
                field=f"{field}.at_m",
                value=fault.at_m,
            )


def _some(layout: Layout) -> str:
    return f"{layout.stations[0].name} ... {layout.stations[-1].name}"
