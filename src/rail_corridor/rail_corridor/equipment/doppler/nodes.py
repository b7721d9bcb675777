"""The nodes of Doppler positioning: reference stations, their medium, and the positioners."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.equipment.subsystem import PlanContext
from rail_corridor.scenario.model import Scenario
from rail_world.line.track import Track
from rail_world.trains.description import TrainDescription

from .placement import references_of
from .section import REFERENCES, ReferencePlan

#: Points of the line that a positioner is given are this far apart [m].
_LINE_STEP_M: Final = 5.0


def doppler_nodes(scenario: Scenario, context: PlanContext) -> list[NodeSpec]:
    """Nodes of Doppler positioning; none without reference stations."""
    plan = REFERENCES.of(scenario)
    if plan is None:
        return []
    nodes = [context.medium("reference_medium")]
    tones = tone_parameters(plan)
    for station in references_of(scenario):
        parameters = tones | {
            "slot": station.slot,
            "power_dbm": plan.power_dbm,
            "tick_s": scenario.tick_s,
        }
        name = f"/wayside/{station.name}/reference"
        nodes.append(NodeSpec("reference_station", name, "wayside", parameters))
    for train in scenario.trains:
        parameters = tones | _line(scenario, train.route[0]) | _positioner(plan, train)
        parameters |= {"tick_s": scenario.tick_s, "timeout_s": 5 * context.timeout_s / 10}
        parameters |= context.offers("doppler_positioner", scenario, train.name)
        nodes.append(
            NodeSpec("doppler_positioner", f"/{train.name}/doppler", "onboard", parameters)
        )
    return nodes


def _positioner(plan: ReferencePlan, train: TrainDescription) -> dict[str, Any]:
    return {
        "track": train.route[0],
        "direction": train.direction,
        "start_m": train.start_m,
        "station_hz": 1e-9 * plan.station_ppb * plan.carrier_hz,
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
    stations = [s for s in references_of(scenario) if s.track == name]
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
