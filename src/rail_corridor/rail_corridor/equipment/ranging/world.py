"""The radio of phase ranging as the world has it, and the map of it that the wayside has."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rail_corridor.scenario.model import Scenario
from rail_world.line.drawing import Drawing, Mast, Stretch
from rail_world.ranging.description import (
    AntennaPattern,
    RadioDescription,
    RadioFault,
    StationAntenna,
)

from .layout import Layout, Zone, layout_of
from .section import CHANNELS, RADIO, SIGNAL, DeadStation, Jam

#: Antennas of a branching station look this far outward, so that their levels part at once.
SQUINT_RAD = math.radians(25.0)


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


def radio_of(scenario: Scenario) -> RadioDescription:
    """Antennas, patterns, noise and faults of the radio."""
    layout, plan = layout_of(scenario), RADIO.of(scenario)
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
                    coverage_range_m=coverage_range_m(scenario, layout, zone),
                )
            )
    pattern = {
        "beamwidth_deg": plan.wrs_beamwidth_deg,
        "front_to_back_db": plan.front_to_back_db,
    }
    return RadioDescription(
        sample_rate_hz=SIGNAL.of(scenario).sample_rate_hz,
        samples=SIGNAL.of(scenario).samples,
        carriers_hz=CHANNELS.of(scenario).carriers_hz,
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
        faults=tuple(
            _fault(scenario, fault)
            for fault in scenario.faults
            if isinstance(fault, DeadStation | Jam)
        ),
    )


def drawing_of(scenario: Scenario) -> Drawing:
    """Masts, and zones coloured by their channel pairs."""
    layout = layout_of(scenario)
    return Drawing(
        masts=tuple(Mast(name=s.name, position_m=s.position_m) for s in layout.stations),
        stretches=tuple(
            Stretch(
                name=zone.name,
                track=zone.track,
                start_m=zone.start_m,
                end_m=zone.end_m,
                group=zone.downlink_channel,
            )
            for zone in layout.zones
        ),
    )


def coverage_range_m(scenario: Scenario, layout: Layout, zone: Zone) -> float:
    """Distance past which the station of a zone neither hears nor is heard.

    Two zones (Jeong et al., section 2.5): the straight line to the end of the next zone, the
    nearest where the line branches, so that the third zone may use the same channels again.
    """
    plan = RADIO.of(scenario)
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


def _fault(scenario: Scenario, fault: Any) -> RadioFault:
    if isinstance(fault, DeadStation):
        return RadioFault(
            kind="dead_station", station=fault.station, from_s=fault.from_s, to_s=fault.to_s
        )
    pose = scenario.network.tracks[fault.track].pose(fault.at_m)
    # Beside the track, at the height of a mast.
    return RadioFault(
        kind="jam",
        channel=fault.channel,
        power_dbm=fault.power_dbm,
        from_s=fault.from_s,
        to_s=fault.to_s,
        position_m=(float(pose.x_m) + 10.0, float(pose.y_m), float(pose.z_m) + 5.0),
    )
