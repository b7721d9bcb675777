"""What the world of a scenario is: the map that the wayside has of it, and its radio."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rail_corridor.equipment.doppler.nodes import reference_description
from rail_corridor.equipment.ranging.layout import Layout, Zone
from rail_corridor.equipment.train_bus.nodes import bus_description
from rail_corridor.equipment.train_radio.nodes import cbtc_description, threat_periods
from rail_corridor.scenario.fault_sections import DeadStation, DeadTransmitter, Jam, Sanding
from rail_corridor.scenario.fault_sections import TrainStop as TrainStopFault
from rail_corridor.scenario.fault_sections import WheelSlip as WheelSlipFault
from rail_corridor.scenario.model import Scenario
from rail_world.ranging.description import (
    AntennaPattern,
    Fault,
    RadioDescription,
    StationAntenna,
    ZoneExtent,
)
from rail_world.track_code.description import Harmonic, RailDescription, RailFault, TrackCircuit
from rail_world.world_file import TrainStop, WheelSlip, WorldFile

from .announcement import announcement

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


def world_file(scenario: Scenario, layout: Layout) -> WorldFile:
    """Tracks, trains, antennas and faults of a run, as the world and its media read them."""
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
        faults=tuple(
            _fault(scenario, fault)
            for fault in scenario.faults
            if isinstance(fault, DeadStation | Jam)
        ),
    )
    return WorldFile(
        seed=scenario.seed,
        tick_s=scenario.tick_s,
        tracks=scenario.tracks,
        junctions=scenario.junctions,
        trains=scenario.trains,
        radio=radio,
        rails=rails_of(scenario),
        cbtc=cbtc_description(scenario),
        threats=threat_periods(scenario),
        references=reference_description(scenario),
        bus=bus_description(scenario),
        stops=tuple(
            TrainStop(train=fault.train, from_s=fault.from_s, to_s=fault.to_s)
            for fault in scenario.faults
            if isinstance(fault, TrainStopFault)
        ),
        slips=tuple(
            WheelSlip(train=fault.train, from_s=fault.from_s, to_s=fault.to_s, ratio=fault.ratio)
            for fault in scenario.faults
            if isinstance(fault, WheelSlipFault)
        ),
        odometer_error=scenario.odometer_error,
        zones=tuple(
            ZoneExtent(
                zone=zone.name,
                track=zone.track,
                start_m=zone.start_m,
                end_m=zone.end_m,
                downlink_channel=zone.downlink_channel,
            )
            for zone in layout.zones
        ),
        scenario=announcement(scenario),
    )


def rails_of(scenario: Scenario) -> RailDescription | None:
    """The rails and their circuits, None where there are none."""
    plan = scenario.track_circuits
    if plan is None:
        return None
    # A wave of amplitude 1 over the noise in 300 Hz.
    noise_v = math.sqrt(0.5 * plan.sample_rate_hz / 600.0) * 10.0 ** (-plan.snr_db / 20.0)
    faults = [f for f in scenario.faults if isinstance(f, Sanding | DeadTransmitter)]
    return RailDescription(
        circuits=tuple(
            TrackCircuit(
                name=c.name,
                track=c.track,
                start_m=c.start_m,
                end_m=c.end_m,
                carrier_hz=c.carrier_hz,
            )
            for c in scenario.circuits
        ),
        trains=tuple(train.name for train in scenario.trains),
        tracks=tuple(scenario.tracks),
        sample_rate_hz=plan.sample_rate_hz,
        attenuation_db_per_km=plan.attenuation_db_per_km,
        joint_attenuation_db=plan.joint_db,
        white_noise_v=noise_v,
        impulse_rate_per_s=plan.impulses_per_s,
        impulse_amplitude_v=1.0 if plan.impulses_per_s else 0.0,
        harmonics=tuple(
            Harmonic(order=order, amplitude_v=10.0 ** (level_db / 20.0))
            for order, level_db in plan.harmonics
        ),
        faults=tuple(RailFault(**fault.model_dump()) for fault in faults),
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
