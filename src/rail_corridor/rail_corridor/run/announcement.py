"""What a corridor says about itself on ``/world/scenario``: one JSON object, complete in itself.

Beside the scenario as it was loaded it holds what follows from it - where stations, zones,
circuits and base stations lie - so that who draws or replays a run needs none of this package.
"""

from __future__ import annotations

import json
from typing import Any

from rail_corridor.equipment.train_radio.nodes import burst_format, radio_parameters
from rail_corridor.scenario.model import Scenario


def announcement(scenario: Scenario) -> str:
    """JSON text of a scenario and its layout."""
    return json.dumps(_layout(scenario) | {"scenario": json.loads(scenario.to_json())})


def _layout(scenario: Scenario) -> dict[str, Any]:
    network, layout = scenario.network, scenario.layout
    junctions = {junction.branch: junction for junction in network.junctions}
    return {
        "name": scenario.name,
        "description": scenario.description,
        "seed": scenario.seed,
        "tick_s": scenario.tick_s,
        "duration_s": scenario.duration_s,
        "tracks": [
            {
                "name": name,
                "length_m": track.length_m,
                "from": junctions[name].track if name in junctions else None,
                "from_m": junctions[name].at_m if name in junctions else 0.0,
            }
            for name, track in network.tracks.items()
        ],
        "stations": [
            {"name": s.name, "track": s.track, "at_m": s.at_m, "position_m": s.position_m}
            for s in layout.stations
        ],
        "zones": [
            {
                "name": zone.name,
                "station": zone.station,
                "track": zone.track,
                "start_m": zone.start_m,
                "end_m": zone.end_m,
                "downlink": zone.downlink_channel,
                "uplink": zone.uplink_channel,
            }
            for zone in layout.zones
        ],
        "circuits": [
            {
                "name": circuit.name,
                "track": circuit.track,
                "start_m": circuit.start_m,
                "end_m": circuit.end_m,
                "carrier_hz": circuit.carrier_hz,
            }
            for circuit in scenario.circuits
        ],
        "bases": [
            {
                "name": base.name,
                "track": base.track,
                "at_m": base.chainage_m,
                "position_m": base.position_m,
                "channel": base.channel,
            }
            for base in scenario.bases
        ],
        "references": [
            {
                "name": station.name,
                "track": station.track,
                "at_m": station.chainage_m,
                "position_m": station.position_m,
            }
            for station in scenario.reference_stations
        ],
        "trains": [
            {
                "name": train.name,
                "length_m": train.vehicle.length_m,
                "direction": train.direction,
                "route": list(train.route),
            }
            for train in scenario.trains
        ],
        "faults": [fault.model_dump(mode="json") for fault in scenario.faults],
        "bursts": _bursts(scenario),
    }


def _bursts(scenario: Scenario) -> dict[str, Any] | None:
    """What the bursts of the train radio are made of, None without one."""
    plan = scenario.cbtc
    if plan is None:
        return None
    burst = burst_format(plan)
    return radio_parameters(scenario, plan) | {
        "data_bits": burst.data_bits,
        "samples": burst.samples,
    }
