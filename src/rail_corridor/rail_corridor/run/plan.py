"""From a scenario to nodes: what runs, with which parameters, in which process."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from rail_corridor.equipment.doppler.nodes import positioning_nodes
from rail_corridor.equipment.node_spec import NodeSpec, Side
from rail_corridor.equipment.ranging.calibration import Transponder, calibrate
from rail_corridor.equipment.ranging.layout import Layout
from rail_corridor.equipment.track_code.nodes import code_nodes
from rail_corridor.equipment.train_bus.nodes import CLOCKED as BUS_CLOCKED
from rail_corridor.equipment.train_bus.nodes import bus_nodes
from rail_corridor.equipment.train_radio.nodes import cbtc_nodes, controller_parameters
from rail_corridor.errors import InputError
from rail_corridor.scenario.model import Scenario
from rail_world.ranging.medium import THERMAL_NOISE_DBM_PER_HZ
from rail_world.world_file import WorldFile

from .world_plan import survey, world_file

Placement = Literal["one", "site", "node"]

WORLD, MEDIUM, CONTROLLER = "/world", "/world/radio_medium", "/wayside/zone_controller"
#: Full name of the node that reads the run for its report.
REPORT: Final = "/report"
#: Participants of one host that discovery on the local host can bring together, with margin.
MOST_PROCESSES = 26


@dataclass(frozen=True)
class Plan:
    """Everything that a run needs, made from a scenario before anything starts."""

    scenario: str
    seed: int
    ticks: int
    tick_s: float
    nodes: tuple[NodeSpec, ...]
    world: WorldFile
    transponders: dict[str, Transponder]

    def groups(
        self, placement: Placement, only: Side | None = None, external: Iterable[str] = ()
    ) -> dict[str, list[NodeSpec]]:
        """Nodes by process.

        Parameters
        ----------
        placement : 'one', 'site' or 'node'
        only : 'wayside' or 'onboard', optional
            Part of the corridor that this host runs; the world is with the wayside.
        external : iterable of str
            Full names of nodes that somebody else runs; the corridor waits for them.
        """
        others = set(external)
        sides = {None: None, "wayside": ("world", "wayside"), "onboard": ("onboard",)}[only]
        nodes = [spec for spec in self.nodes if sides is None or spec.side in sides]
        nodes = [spec for spec in nodes if spec.name not in others]
        if placement == "one":
            return {"corridor": nodes}
        groups: dict[str, list[NodeSpec]] = {}
        for spec in nodes:
            key = spec.site if placement == "site" else spec.name.strip("/").replace("/", "_")
            groups.setdefault(key, []).append(spec)
        return _packed(groups)


def check_external(plan: Plan, external: Iterable[str]) -> None:
    """Raise InputError for a node that cannot be somebody else's."""
    known = [spec.name for spec in plan.nodes if spec.name != WORLD]
    for name in external:
        if name in known:
            continue
        close = difflib.get_close_matches(name, known, n=1)
        reason = "the corridor has no such node that could be replaced"
        reason += f", did you mean {close[0]}" if close else ""
        raise InputError(reason, field="--external", value=name)


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
    bystanders: Iterable[str] = (),
) -> Plan:
    """Plan a run; writes the world file into ``run_directory``.

    The world waits for the nodes of the plan, and for ``bystanders``, which are not in it.
    """
    layout = scenario.layout
    seeds = np.random.SeedSequence([scenario.seed, 2]).spawn(max(1, len(scenario.trains)))
    transponders = {
        train.name: calibrate(
            scenario.transponder, scenario.ranging.signal, np.random.default_rng(seed)
        )
        for train, seed in zip(scenario.trains, seeds, strict=False)
    }
    world = world_file(scenario, layout)
    world_path = run_directory / "world.json"
    world_path.write_text(world.model_dump_json())
    equipment = [
        *(_station(scenario, layout, station.name) for station in layout.stations),
        *(_vehicle(scenario, name, unit) for name, unit in transponders.items()),
    ]
    controller = NodeSpec(
        "zone_controller", CONTROLLER, "wayside", _controller(scenario, layout, 3 * timeout_s / 5)
    )
    medium = NodeSpec(
        "radio_medium",
        MEDIUM,
        "world",
        {"world_file": str(world_path), "timeout_s": 2 * timeout_s / 5},
    )
    more = [
        *code_nodes(scenario, str(world_path), timeout_s),
        *cbtc_nodes(scenario, str(world_path), timeout_s),
        *positioning_nodes(scenario, str(world_path), timeout_s),
        *bus_nodes(scenario, str(world_path), timeout_s),
    ]
    others = [medium, controller, *equipment, *more]
    sinks = [MEDIUM, CONTROLLER, *(spec.name for spec in more if spec.side == "world")]
    clocked = {
        *("wrs", "track_code_transmitter", "cbtc_base_station", "cbtc_radio", "backbone"),
        *("reference_station", *BUS_CLOCKED),
    }
    supervision = scenario.supervision
    parameters = {
        "world_file": str(world_path),
        "ticks": scenario.ticks,
        "rate": float(rate),
        "nodes": (*(spec.name for spec in others), *bystanders),
        "sinks": tuple(sinks),
        "clock_readers": len(
            {CONTROLLER, *(spec.name for spec in others if spec.kind in clocked)} - {*external}
        ),
        "supervised": tuple(scenario.supervised),
        "odometers": scenario.with_odometer,
        "supervision": supervision.node if supervision else "",
        "cab_signals": supervision is None or supervision.cab_signals,
        "observed": observed,
        "end_when_arrived": scenario.end_when_arrived,
        "timeout_s": timeout_s,
    }
    nodes = (NodeSpec("world", WORLD, "world", parameters), *others)
    return Plan(
        scenario.name, scenario.seed, scenario.ticks, scenario.tick_s, nodes, world, transponders
    )


def _signal(scenario: Scenario) -> dict[str, Any]:
    signal = scenario.ranging.signal
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
        + scenario.radio.noise_figure_db
        + 10.0 * math.log10(scenario.ranging.sample_rate_hz)
    )


def _station(scenario: Scenario, layout: Layout, name: str) -> NodeSpec:
    zones = [layout.zone(zone) for zone in layout.station(name).zones]
    carriers = scenario.channels.carriers_hz
    parameters = {
        **_signal(scenario),
        "zones": tuple(zone.name for zone in zones),
        "downlink_channels": tuple(zone.downlink_channel for zone in zones),
        "uplink_channels": tuple(zone.uplink_channel for zone in zones),
        "downlink_carriers_hz": tuple(carriers[zone.downlink_channel] for zone in zones),
        "power_dbm": scenario.radio.wrs_power_dbm,
        "comparator": scenario.ranging.comparator,
        "delay_s": scenario.transponder.delay_s,
        "noise_dbm": _noise_dbm(scenario),
    }
    return NodeSpec("wrs", f"/wayside/{name}", "wayside", parameters)


def _pairs(layout: Layout) -> dict[int, int]:
    pairs = {zone.downlink_channel: zone.uplink_channel for zone in layout.zones}
    return dict(sorted(pairs.items()))


def _vehicle(scenario: Scenario, name: str, unit: Transponder) -> NodeSpec:
    pairs = _pairs(scenario.layout)
    parameters = {
        **_signal(scenario),
        "downlink_channels": tuple(pairs),
        "uplink_channels": tuple(pairs.values()),
        "uplink_carriers_hz": tuple(scenario.channels.carriers_hz[c] for c in pairs.values()),
        "power_dbm": scenario.radio.vrs_power_dbm,
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
        **controller_parameters(scenario),
    }
