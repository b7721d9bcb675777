"""The nodes of phase ranging: the radio, stations, transponders and the zone controller."""

from __future__ import annotations

import math
from typing import Any, Final

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.equipment.subsystem import PlanContext
from rail_corridor.scenario.model import Scenario
from rail_world.ranging.medium import THERMAL_NOISE_DBM_PER_HZ

from .calibration import Transponder, transponders_of
from .layout import Layout, layout_of
from .section import CHANNELS, RADIO, SIGNAL, TRANSPONDER
from .world import survey

CONTROLLER: Final = "/wayside/zone_controller"
MEDIUM: Final = "/world/radio_medium"


def ranging_nodes(scenario: Scenario, context: PlanContext) -> list[NodeSpec]:
    """Nodes of phase ranging."""
    layout = layout_of(scenario)
    controller = _controller(scenario, layout, 3 * context.timeout_s / 5)
    controller |= context.offers("zone_controller", scenario)
    return [
        context.medium("radio_medium"),
        NodeSpec("zone_controller", CONTROLLER, "wayside", controller),
        *(_station(scenario, layout, station.name) for station in layout.stations),
        *(_vehicle(scenario, name, unit) for name, unit in transponders_of(scenario).items()),
    ]


def _signal(scenario: Scenario) -> dict[str, Any]:
    signal = SIGNAL.of(scenario).signal
    return {
        "tones_hz": signal.tones_hz,
        "deviations_hz": signal.deviations_hz,
        "sample_rate_hz": signal.sample_rate_hz,
        "samples": signal.samples,
    }


def _noise_dbm(scenario: Scenario) -> float:
    """Noise of every receiver in the bandwidth of a burst."""
    return (
        THERMAL_NOISE_DBM_PER_HZ
        + RADIO.of(scenario).noise_figure_db
        + 10.0 * math.log10(SIGNAL.of(scenario).sample_rate_hz)
    )


def _station(scenario: Scenario, layout: Layout, name: str) -> NodeSpec:
    zones = [layout.zone(zone) for zone in layout.station(name).zones]
    carriers = CHANNELS.of(scenario).carriers_hz
    parameters = {
        **_signal(scenario),
        "zones": tuple(zone.name for zone in zones),
        "downlink_channels": tuple(zone.downlink_channel for zone in zones),
        "uplink_channels": tuple(zone.uplink_channel for zone in zones),
        "downlink_carriers_hz": tuple(carriers[zone.downlink_channel] for zone in zones),
        "power_dbm": RADIO.of(scenario).wrs_power_dbm,
        "comparator": SIGNAL.of(scenario).comparator,
        "delay_s": TRANSPONDER.of(scenario).delay_s,
        "noise_dbm": _noise_dbm(scenario),
    }
    return NodeSpec("wrs", f"/wayside/{name}", "wayside", parameters)


def _pairs(layout: Layout) -> dict[int, int]:
    pairs = {zone.downlink_channel: zone.uplink_channel for zone in layout.zones}
    return dict(sorted(pairs.items()))


def _vehicle(scenario: Scenario, name: str, unit: Transponder) -> NodeSpec:
    pairs = _pairs(layout_of(scenario))
    parameters = {
        **_signal(scenario),
        "downlink_channels": tuple(pairs),
        "uplink_channels": tuple(pairs.values()),
        "uplink_carriers_hz": tuple(CHANNELS.of(scenario).carriers_hz[c] for c in pairs.values()),
        "power_dbm": RADIO.of(scenario).vrs_power_dbm,
        "transponder_delay_s": unit.delay_s,
        "delay_trim_s": unit.trim_s,
        "noise_dbm": _noise_dbm(scenario),
    }
    return NodeSpec("vrs", f"/{name}/vrs", "onboard", parameters)


def _controller(scenario: Scenario, layout: Layout, timeout_s: float) -> dict[str, Any]:
    tables = [survey(scenario, layout, zone) for zone in layout.zones]
    follows = [(zone.name, after) for zone in layout.zones for after in zone.next]
    trains = sorted(scenario.trains, key=lambda train: train.depart_s)
    entry = [layout.zone_at(train.route[0], train.start_m).name for train in trains]
    return {
        "zones": tuple(zone.name for zone in layout.zones),
        "sites": tuple(zone.station for zone in layout.zones),
        "tracks": tuple(zone.track for zone in layout.zones),
        "starts_m": tuple(zone.start_m for zone in layout.zones),
        "ends_m": tuple(zone.end_m for zone in layout.zones),
        "follows_from": tuple(before for before, _ in follows),
        "follows_to": tuple(after for _, after in follows),
        "table_sizes": tuple(len(chainage) for chainage, _ in tables),
        "table_chainage_m": tuple(float(x) for chainage, _ in tables for x in chainage),
        "table_distance_m": tuple(float(x) for _, distance in tables for x in distance),
        "trains": tuple(train.name for train in trains),
        "entry_zones": tuple(entry),
        "timeout_s": timeout_s,
    }
