"""From a scenario to nodes: what runs, with which parameters, in which process."""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rail_world.radio import THERMAL_NOISE_DBM_PER_HZ
from rail_world.radio_description import (
    AntennaPattern,
    Fault,
    RadioDescription,
    StationAntenna,
)
from rail_world.world_file import WorldFile

from .calibration import Transponder, calibrate
from .errors import InputError
from .layout import Layout, Zone
from .scenario import Scenario
from .sections import DeadStation

Placement = Literal["one", "site", "node"]
Side = Literal["world", "wayside", "onboard"]

WORLD, MEDIUM, CONTROLLER = "/world", "/world/radio_medium", "/wayside/zone_controller"
#: Participants of one host that discovery on the local host can bring together, with margin.
MOST_PROCESSES = 26
#: Antennas of a branching station look this far outward, so that their levels part at once.
SQUINT_RAD = math.radians(25.0)


@dataclass(frozen=True)
class NodeSpec:
    """One node: its kind, its full name, where it belongs, its parameters."""

    kind: str
    name: str
    side: Side
    parameters: dict[str, Any] = field(default_factory=dict)

    @property
    def site(self) -> str:
        """What it shares a process with: its wayside site or train."""
        if self.side == "world":
            return "world"
        parts = self.name.strip("/").split("/")
        return parts[1] if parts[0] == "wayside" else parts[0]


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
    timeout_s: float = 5.0,
    external: Iterable[str] = (),
) -> Plan:
    """Plan a run; writes the world file into ``run_directory``."""
    layout = scenario.layout
    seeds = np.random.SeedSequence([scenario.seed, 2]).spawn(max(1, len(scenario.trains)))
    transponders = {
        train.name: calibrate(
            scenario.transponder, scenario.ranging.signal, np.random.default_rng(seed)
        )
        for train, seed in zip(scenario.trains, seeds, strict=False)
    }
    world = _world_file(scenario, layout)
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
    others = [medium, controller, *equipment]
    parameters = {
        "world_file": str(world_path),
        "ticks": scenario.ticks,
        "rate": float(rate),
        "nodes": tuple(spec.name for spec in others),
        "sinks": (MEDIUM, CONTROLLER),
        "clock_readers": len(
            {CONTROLLER, *(spec.name for spec in equipment if spec.kind == "wrs")} - {*external}
        ),
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
    }


def survey(
    scenario: Scenario, layout: Layout, zone: Zone
) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Chainage and distance from the mast of points of a zone and of the next on the track.

    Close together near the mast, where the distance bends; only as far as it increases.
    """
    track = scenario.network.tracks[zone.track]
    after = [layout.zone(name) for name in zone.next]
    end_m = max([zone.end_m, *(z.end_m for z in after if z.track == zone.track)])
    span_m = min(end_m, track.length_m) - zone.start_m
    steps = np.concatenate(
        [np.arange(0.0, 12.0, 0.05), np.arange(12.0, 40.0, 0.25), np.arange(40.0, span_m, 1.0)]
    )
    chainage = zone.start_m + np.append(steps[steps < span_m], span_m)
    pose = track.pose(chainage)
    mast = np.array(layout.station(zone.station).position_m)
    line = np.stack((pose.x_m, pose.y_m, pose.z_m), axis=1) - mast
    distance = np.sqrt(np.einsum("nk,nk->n", line, line))
    first = int(np.argmin(distance[: distance.size // 2 + 1]))
    rising = np.flatnonzero(np.diff(distance[first:]) <= 0.0)
    last = first + 1 + (int(rising[0]) if rising.size else distance.size - first - 1)
    return chainage[first:last], distance[first:last]


def _world_file(scenario: Scenario, layout: Layout) -> WorldFile:
    plan = scenario.radio
    antennas = []
    for station in layout.stations:
        zones = [layout.zone(name) for name in station.zones]
        for zone in zones:
            others = [other for other in zones if other is not zone]
            antennas.append(
                StationAntenna(
                    site=station.name,
                    zone=zone.name,
                    position_m=station.position_m,
                    boresight=_squinted(zone, others),
                    downlink_channel=zone.downlink_channel,
                    uplink_channel=zone.uplink_channel,
                    reach_m=reach_m(scenario, layout, zone),
                )
            )
    pattern = {
        "beamwidth_deg": plan.wrs_beamwidth_deg,
        "front_to_back_db": plan.front_to_back_db,
    }
    radio = RadioDescription(
        sample_rate_hz=scenario.ranging.sample_rate_hz,
        samples=scenario.ranging.samples,
        carriers_hz=scenario.channels.carriers_hz,
        stations=tuple(antennas),
        trains=tuple(train.name for train in scenario.trains),
        station_pattern=AntennaPattern(gain_dbi=plan.wrs_gain_dbi, **pattern),
        train_pattern=AntennaPattern(
            gain_dbi=plan.vrs_gain_dbi,
            beamwidth_deg=plan.vrs_beamwidth_deg,
            front_to_back_db=plan.front_to_back_db,
        ),
        path_loss_exponent=plan.path_loss_exponent,
        noise_figure_db=plan.noise_figure_db,
        oscillator_ppm=plan.oscillator_ppm,
        faults=tuple(_fault(scenario, fault) for fault in scenario.faults),
    )
    return WorldFile(
        seed=scenario.seed,
        tick_s=scenario.tick_s,
        tracks=scenario.tracks,
        junctions=scenario.junctions,
        trains=scenario.trains,
        radio=radio,
    )


def reach_m(scenario: Scenario, layout: Layout, zone: Zone) -> float:
    """Distance past which the station of a zone neither hears nor is heard.

    Two zones (Jeong et al., section 2.5): the straight line to the end of the next zone, the
    nearest where the line branches, so that the third zone may use the same channels again.
    """
    plan = scenario.radio
    mast = np.array(layout.station(zone.station).position_m)
    ends = [layout.zone(name) for name in zone.next] or [zone]
    distances = []
    for end in ends:
        pose = scenario.network.tracks[end.track].pose(end.end_m)
        place = np.array([float(pose.x_m), float(pose.y_m), float(pose.z_m)])
        distances.append(float(np.linalg.norm(place - mast)))
    own_m = zone.length_m
    return max(own_m + 1.0, min(distances) * plan.reach_zones / 2.0)


def _squinted(zone: Zone, others: Sequence[Zone]) -> tuple[float, float, float]:
    """Boresight of an antenna, turned away from that of the same station's other antenna."""
    x, y, z = zone.boresight
    if not others:
        return zone.boresight
    ox, oy, _ = others[0].boresight
    turn = math.copysign(SQUINT_RAD, ox * y - oy * x)
    cos, sin = math.cos(turn), math.sin(turn)
    return (cos * x - sin * y, sin * x + cos * y, z)


def _fault(scenario: Scenario, fault: Any) -> Fault:
    if isinstance(fault, DeadStation):
        return Fault(
            kind="dead_station", station=fault.station, from_s=fault.from_s, to_s=fault.to_s
        )
    pose = scenario.network.tracks[fault.track].pose(fault.at_m)
    # Beside the track, at the height of a mast.
    return Fault(
        kind="jam",
        channel=fault.channel,
        power_dbm=fault.power_dbm,
        from_s=fault.from_s,
        to_s=fault.to_s,
        position_m=(float(pose.x_m) + 10.0, float(pose.y_m), float(pose.z_m) + 5.0),
    )


def write_nodes(path: Path, specs: Iterable[NodeSpec]) -> None:
    """Write the nodes of one process, for those who want to start it by hand."""
    path.write_text(json.dumps([asdict(spec) for spec in specs], indent=1))
