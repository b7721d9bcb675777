"""The nodes of positioning on board: reference stations, their medium, positioners, localizers."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.equipment.train_radio.nodes import PLACED_M, SIGMAS
from rail_corridor.scenario.fault_sections import DeadReference, DetunedReference
from rail_corridor.scenario.model import Scenario
from rail_world.doppler.description import ReferenceDescription, ReferenceFault, ReferenceStation
from rail_world.line.track import Track
from rail_world.trains.description import TrainDescription

from .section import LocalizerPlan, ReferencePlan

REFERENCE_MEDIUM: Final = "/world/reference_medium"
#: Random walk that a positioner counts on of its own oscillator, after a second [Hz].
WALK_HZ: Final = 0.5
#: Points of the line that a positioner is given are so far apart [m].
_LINE_STEP_M: Final = 5.0


def reference_description(scenario: Scenario) -> ReferenceDescription | None:
    """The medium of the reference tones, None where there is none."""
    plan = scenario.references
    if plan is None:
        return None
    faults = [f for f in scenario.faults if isinstance(f, DeadReference | DetunedReference)]
    return ReferenceDescription(
        stations=tuple(
            ReferenceStation(
                name=station.name,
                track=station.track,
                chainage_m=station.chainage_m,
                position_m=station.position_m,
            )
            for station in scenario.reference_stations
        ),
        trains=tuple(train.name for train in scenario.trains),
        tracks=tuple(scenario.tracks),
        carrier_hz=plan.carrier_hz,
        sample_rate_hz=plan.sample_rate_hz,
        samples=plan.samples,
        noise_figure_db=plan.noise_figure_db,
        path_loss_exponent=plan.path_loss_exponent,
        extra_loss_db=plan.extra_loss_db,
        reach_m=plan.reach_m,
        receiver_ppm=plan.receiver_ppm,
        station_ppb=plan.station_ppb,
        faults=tuple(ReferenceFault(**fault.model_dump()) for fault in faults),
    )


def positioning_nodes(scenario: Scenario, world_file: str, timeout_s: float) -> list[NodeSpec]:
    """Nodes of positioning on board; none without reference stations and localizer."""
    nodes: list[NodeSpec] = []
    plan = scenario.references
    if plan is not None:
        medium = {"world_file": world_file, "timeout_s": 2 * timeout_s / 5}
        nodes.append(NodeSpec("reference_medium", REFERENCE_MEDIUM, "world", medium))
        tones = tone_parameters(plan)
        for station in scenario.reference_stations:
            parameters = tones | {
                "slot": station.slot,
                "power_dbm": plan.power_dbm,
                "tick_s": scenario.tick_s,
            }
            name = f"/wayside/{station.name}/reference"
            nodes.append(NodeSpec("reference_station", name, "wayside", parameters))
        for train in scenario.trains:
            parameters = (
                tones | _line(scenario, train.route[0]) | _positioner(scenario, plan, train)
            )
            nodes.append(
                NodeSpec("doppler_positioner", f"/{train.name}/doppler", "onboard", parameters)
            )
    if scenario.localizer is not None:
        for train in scenario.trains:
            parameters = _localizer(scenario, scenario.localizer, train, timeout_s)
            name = f"/{train.name}/localizer"
            nodes.append(NodeSpec("localizer", name, "onboard", parameters))
    return nodes


def _positioner(scenario: Scenario, plan: ReferencePlan, train: TrainDescription) -> dict[str, Any]:
    return {
        "track": train.route[0],
        "direction": train.direction,
        "start_m": train.start_m,
        "walk_hz": WALK_HZ,
        "station_hz": 1e-9 * plan.station_ppb * plan.carrier_hz,
        "localizer": scenario.localizer is not None,
    }


def _localizer(
    scenario: Scenario, plan: LocalizerPlan, train: TrainDescription, timeout_s: float
) -> dict[str, Any]:
    name = train.route[0]
    by_radio = scenario.cbtc is not None
    joints = [c for c in scenario.circuits if c.track == name]
    behind = joints[1:] if train.direction > 0 else joints[:-1]
    return {
        "track": name,
        "direction": train.direction,
        "start_m": train.start_m,
        "placed_m": PLACED_M / SIGMAS,
        "doppler": scenario.references is not None,
        "told": by_radio,
        "ranged": not by_radio,
        "told_sigmas": SIGMAS,
        "joints_m": tuple(c.start_m if train.direction > 0 else c.end_m for c in behind),
        "joint_carriers_hz": tuple(c.carrier_hz for c in behind),
        "zone_starts_m": tuple(
            sorted(zone.start_m for zone in scenario.layout.zones if zone.track == name)
        ),
        "odometer_scale": max(plan.odometer_error, scenario.odometer_error),
        "integrity_risk": plan.integrity_risk,
        "oldest_s": max(1.5, 6.0 * scenario.tick_s),
        "tick_s": scenario.tick_s,
        "timeout_s": 5 * timeout_s / 10,
    }


def tone_parameters(plan: ReferencePlan) -> dict[str, Any]:
    """Parameters of the tones, which stations and receivers share."""
    tones = plan.tones
    return {
        "carrier_hz": tones.carrier_hz,
        "sample_rate_hz": tones.sample_rate_hz,
        "samples": tones.samples,
        "slots": tones.slots,
        "spacing_hz": tones.spacing_hz,
        "max_speed_mps": tones.max_speed_mps,
        "max_offset_ppm": tones.max_offset_ppm,
        "min_distance_m": tones.min_distance_m,
    }


def _line(scenario: Scenario, name: str) -> dict[str, Any]:
    """The line as a positioner knows it, and the stations along it."""
    track: Track = scenario.network.tracks[name]
    count = int(np.ceil(track.length_m / _LINE_STEP_M)) + 1
    chainage_m = np.linspace(0.0, track.length_m, count)
    pose = track.pose(chainage_m)
    stations = [s for s in scenario.reference_stations if s.track == name]
    return {
        "line_chainage_m": tuple(chainage_m.tolist()),
        "line_x_m": tuple(pose.x_m.tolist()),
        "line_y_m": tuple(pose.y_m.tolist()),
        "line_z_m": tuple(pose.z_m.tolist()),
        "line_heading_rad": tuple(pose.heading_rad.tolist()),
        "station_slots": tuple(s.slot for s in stations),
        "station_x_m": tuple(s.position_m[0] for s in stations),
        "station_y_m": tuple(s.position_m[1] for s in stations),
        "station_z_m": tuple(s.position_m[2] for s in stations),
    }
