"""What phase ranging must agree on with the rest of a scenario."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from rail_corridor.errors import InputError
from rail_corridor.scenario.model import Scenario
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_world.trains.description import TrainDescription

from .layout import Layout, layout_of
from .section import (
    CHANNELS,
    LONGEST_ZONE_M,
    RADIO,
    SIGNAL,
    STATIONS,
    DeadStation,
    Jam,
    StationPlan,
)

LARGEST_OFFSET_HZ: Final = 5e3
"""Carrier offset that receivers search by default [Hz]."""
_OSCILLATOR_SIGMAS: Final = 3.0
_WHERE_STATIONS: Final = "stations.positions"


def check_ranging(scenario: Scenario, train_fields: Sequence[str]) -> None:
    """Raise InputError for the first thing that does not fit phase ranging."""
    plan = SIGNAL.of(scenario)
    if plan.signal.duration_s > scenario.tick_s:
        raise InputError(
            f"last {plan.signal.duration_s:g} s, longer than a tick of {scenario.tick_s:g} s",
            field="ranging.samples",
            value=plan.samples,
        )
    layout = layout_of(scenario)
    _check_zone_lengths(scenario, layout)
    _check_channels(scenario, layout)
    _check_band(scenario)
    _check_first_zones(scenario, layout, train_fields)
    _check_faults(scenario, layout)


def _check_zone_lengths(scenario: Scenario, layout: Layout) -> None:
    plan, ranging = STATIONS.of(scenario), SIGNAL.of(scenario)
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
    plan = CHANNELS.of(scenario)
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
    signal, plan = SIGNAL.of(scenario).signal, CHANNELS.of(scenario)
    carson_hz = 2.0 * (sum(signal.deviations_hz) + max(signal.tones_hz))
    if plan.spacing_hz < carson_hz:
        raise InputError(
            f"is less than the {carson_hz:g} Hz that the ranging signal takes up (Carson's rule)",
            field="channels.spacing_hz",
            value=plan.spacing_hz,
        )
    highest_hz = max(plan.carriers_hz.values())
    fastest_mps = max((t.vehicle.max_speed_kmh for t in scenario.trains), default=0.0) / 3.6
    relative = math.sqrt(2.0) * _OSCILLATOR_SIGMAS * RADIO.of(scenario).oscillator_ppm * 1e-6
    offset_hz = highest_hz * (relative + fastest_mps / SPEED_OF_LIGHT_M_PER_S)
    if offset_hz > LARGEST_OFFSET_HZ:
        raise InputError(
            f"with Doppler shift, carriers of {highest_hz:g} Hz would be off by up to"
            f" {offset_hz:.0f} Hz, receivers search {LARGEST_OFFSET_HZ:.0f} Hz",
            field="radio.oscillator_ppm",
            value=RADIO.of(scenario).oscillator_ppm,
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
        if fault.channel not in CHANNELS.of(scenario).numbers:
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
