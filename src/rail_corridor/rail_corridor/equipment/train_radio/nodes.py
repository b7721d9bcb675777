"""The nodes of train control by radio: medium, base stations, and radio and protection on board."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import Any, Final, cast

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.equipment.subsystem import PlanContext
from rail_corridor.scenario.actions import ReleaseOnSight
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.quantities import CLAIM_SIGMAS
from rail_msgs_py.train_radio.movement_authority import FASTEST_MPS
from rail_msgs_py.train_radio.quantities import ON_SIGHT
from rail_msgs_py.train_radio.safe_frame import FRAME_BYTES
from rail_onboard.train_radio.authority_curves import AuthorityCurves
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.train_radio.burst import RadioBurstFormat
from rail_signals.train_radio.space_time_block import scheme
from rail_signals.train_radio.symbol_mapping import constellation
from rail_world.line.track import Track
from rail_world.trains.vehicle import Vehicle

from .keys import pair_keys
from .placement import Base, bases_of
from .section import CBTC, CbtcPlan, ClockError
from .world import threats_of

CBTC_MEDIUM: Final = "/world/cbtc_medium"
CONTROLLER: Final = "/wayside/zone_controller"
#: Resistance of the sharpest curve of the line model, force over weight.
_STEEPEST_CURVE: Final = 0.008
#: No train is faster than its design speed by more than this.
FASTER: Final = 1.2


def cbtc_nodes(scenario: Scenario, context: PlanContext) -> list[NodeSpec]:
    """Nodes of train control by radio; none without it."""
    plan, timeout_s = CBTC.of(scenario), context.timeout_s
    if plan is None:
        return []
    radio = radio_parameters(scenario, plan)
    nodes = [context.medium("cbtc_medium", burst_samples=burst_format(plan).samples)]
    threatened = bool(threats_of(scenario).periods)
    if threatened:
        # It waits longer than the medium for base stations, and longer than the controller for it.
        waits = {"timeout_s": timeout_s / 2, "controller_timeout_s": 4 * timeout_s / 5}
        nodes.append(context.medium("backbone", **waits))
    for base in bases_of(scenario):
        parameters = radio | _base(plan, base, timeout_s / 5) | {"backbone": threatened}
        nodes.append(
            NodeSpec("cbtc_base_station", f"/wayside/{base.name}/cbtc", "wayside", parameters)
        )
    for number, train in enumerate(scenario.trains, start=1):
        parameters = radio | _on_board(plan, number, timeout_s / 5)
        protection = _atp(scenario, plan, number, timeout_s)
        protection |= context.offers("atp", scenario, train.name)
        nodes += [
            NodeSpec("cbtc_radio", f"/{train.name}/cbtc_radio", "onboard", parameters),
            NodeSpec("atp", f"/{train.name}/atp", "onboard", protection),
        ]
    return nodes


def burst_format(plan: CbtcPlan) -> RadioBurstFormat:
    """Burst that carries one frame."""
    return RadioBurstFormat(
        scheme(plan.scheme),
        constellation(plan.constellation),
        8 * FRAME_BYTES,
        plan.symbol_rate_hz,
        plan.samples_per_symbol,
        pilot_period=plan.pilot_period,
    )


def clock_parameters(scenario: Scenario, node: str) -> dict[str, Any]:
    """Parameters of the clock of a unit."""
    faults = [f for f in scenario.faults if isinstance(f, ClockError) and f.node == node]
    faults.sort(key=lambda fault: fault.from_s)
    return {
        "clock_from_s": tuple(fault.from_s for fault in faults),
        "clock_offset_s": tuple(fault.offset_s for fault in faults),
        "clock_drift_ppm": tuple(fault.drift_ppm for fault in faults),
    }


def radio_parameters(scenario: Scenario, plan: CbtcPlan) -> dict[str, Any]:
    """Parameters of the train radio that are the same at the wayside and on board."""
    fastest_mps = max(train.vehicle.max_speed_kmh for train in scenario.trains) / 3.6
    highest_hz = max(plan.uplinks_hz.values())
    return {
        "scheme": plan.scheme,
        "constellation": plan.constellation,
        "symbol_rate_hz": plan.symbol_rate_hz,
        "samples_per_symbol": plan.samples_per_symbol,
        "pilot_period": plan.pilot_period,
        "trains": len(scenario.trains),
        "doppler_hz": fastest_mps * highest_hz / SPEED_OF_LIGHT_M_PER_S,
        "tick_s": scenario.tick_s,
    }


def _base(plan: CbtcPlan, base: Base, timeout_s: float) -> dict[str, Any]:
    return {
        "downlink_channel": base.channel,
        "downlink_carrier_hz": plan.downlinks_hz[base.channel],
        "power_dbm": plan.base_power_dbm,
        "timeout_s": timeout_s,
    }


def _on_board(plan: CbtcPlan, number: int, timeout_s: float) -> dict[str, Any]:
    return {
        "slot": number,
        "downlink_channels": tuple(plan.downlinks_hz),
        "uplink_carriers_hz": tuple(plan.uplinks_hz.values()),
        "power_dbm": plan.train_power_dbm,
        "timeout_s": timeout_s,
    }


def _atp(scenario: Scenario, plan: CbtcPlan, number: int, timeout_s: float) -> dict[str, Any]:
    train = scenario.trains[number - 1]
    track = scenario.network.tracks[train.route[0]]
    vehicle = Vehicle(train.vehicle)
    releases = releases_of(scenario, train.name)
    return {
        "number": number,
        "segment": list(scenario.network.tracks).index(train.route[0]),
        "start_m": train.start_m,
        "length_m": train.vehicle.length_m,
        "gradient_from_m": tuple(at_m for at_m, _ in gradient_steps(track)),
        "gradient_permil": tuple(permil for _, permil in gradient_steps(track)),
        "braking_mps2": plan.braking_mps2,
        "emergency_mps2": plan.emergency_mps2,
        "band_up_to_mps": tuple(band.up_to_kmh / 3.6 for band in plan.brake_bands),
        "band_braking_mps2": tuple(band.braking_mps2 for band in plan.brake_bands),
        "band_emergency_mps2": tuple(band.emergency_mps2 for band in plan.brake_bands),
        "brake_build_up_s": train.vehicle.brake_build_up_s,
        "fastest_mps": FASTER * train.vehicle.max_speed_kmh / 3.6,
        "cycle_s": plan.cycle_s,
        "report_period_s": plan.report_period_s,
        "traction_mps2": vehicle.traction_mps2(0.0),
        "most_braking_mps2": most_braking_mps2(vehicle, track),
        "releases_s": tuple(each.at_s for each in releases),
        "on_sight_mps": on_sight_mps(releases),
        "odometer_error": CLAIM_SIGMAS.default * plan.odometer_error,
        "authority_timeout_s": plan.timeout_s,
        **clock_parameters(scenario, f"/{train.name}/atp"),
        "secret": pair_keys(scenario)[train.name],
        "seed": scenario.seed,
        "tick_s": scenario.tick_s,
        "timeout_s": 3 * timeout_s / 5,
    }


def curves_of(scenario: Scenario, plan: CbtcPlan, number: int) -> AuthorityCurves:
    """Curves of a train, as its protection makes them.

    Raises
    ------
    ValueError
        If its brakes do not go with its track.
    """
    from rail_onboard.train_radio.atp_node import AtpParameters, supervision_of

    return supervision_of(AtpParameters(**_atp(scenario, plan, number, 1.0))).curves


def gradient_steps(track: Track) -> list[tuple[float, float]]:
    """Gradients of a track [m, permil], from 0 on."""
    return _changes(track.gradients_permil.part(0.0, track.length_m))


def steepest_fall_permil(track: Track) -> float:
    """Steepest fall towards increasing chainage, 0 or more [permil]."""
    steps = track.gradients_permil.part(0.0, track.length_m)
    return max(0.0, *(-gradient for _, gradient in steps))


def most_braking_mps2(vehicle: Vehicle, track: Track) -> float:
    """Most that a train can slow down by on a track [m/s^2]: brakes, resistance and rise."""
    steps = track.gradients_permil.part(0.0, track.length_m)
    rise_permil = max(0.0, *(gradient for _, gradient in steps))
    resistance_mps2 = vehicle.running_resistance_mps2(vehicle.max_speed_mps)
    curves_mps2 = vehicle.gravity_mps2 * _STEEPEST_CURVE
    climb_mps2 = vehicle.gravity_mps2 * 1e-3 * rise_permil
    return vehicle.emergency_brake_mps2 + resistance_mps2 + curves_mps2 + climb_mps2


def releases_of(scenario: Scenario, train: str) -> list[ReleaseOnSight]:
    """When a train is released to run on sight."""
    return [action for action in scenario.actions if action.train == train]


def on_sight_mps(releases: Iterable[ReleaseOnSight]) -> float:
    """Speed of a train on sight: the least that its releases say."""
    return min((each.speed_kmh / 3.6 for each in releases), default=ON_SIGHT.default)


def controller_parameters(scenario: Scenario) -> dict[str, Any]:
    """What the zone controller needs to give authorities; nothing without base stations."""
    plan = CBTC.of(scenario)
    if plan is None:
        return {}
    tracks = scenario.network.tracks
    fastest_mps = max(train.vehicle.max_speed_kmh for train in scenario.trains) / 3.6
    limits = {name: limit_steps(track, fastest_mps) for name, track in tracks.items()}
    numbers = {train.name: number for number, train in enumerate(scenario.trains, start=1)}
    by_departure = sorted(scenario.trains, key=lambda train: train.depart_s)
    return {
        "bases": tuple(base.name for base in bases_of(scenario)),
        "backbone": bool(threats_of(scenario).periods),
        "segments": tuple(tracks),
        "segment_lengths_m": tuple(track.length_m for track in tracks.values()),
        "limit_counts": tuple(len(steps) for steps in limits.values()),
        "limit_from_m": tuple(at for steps in limits.values() for at, _ in steps),
        "limits_mps": tuple(mps for steps in limits.values() for _, mps in steps),
        "train_numbers": tuple(numbers[train.name] for train in by_departure),
        "train_lengths_m": tuple(train.vehicle.length_m for train in by_departure),
        "train_segments": tuple(list(tracks).index(train.route[0]) for train in by_departure),
        "train_starts_m": tuple(train.start_m for train in by_departure),
        "leaves_at_m": tuple(
            tracks[train.route[0]].length_m if train.leaves_on_arrival else 0.0
            for train in by_departure
        ),
        "released_trains": tuple(numbers[each.train] for each in scenario.actions),
        "released_at_s": tuple(each.at_s for each in scenario.actions),
        "released_mps": tuple(
            on_sight_mps(releases_of(scenario, each.train)) for each in scenario.actions
        ),
        "margin_m": plan.margin_m,
        "buffer_m": plan.buffer_m,
        "authority_period_s": plan.authority_period_s,
        **_restrictions(scenario),
        "validity_s": plan.timeout_s,
        **clock_parameters(scenario, CONTROLLER),
        "secrets": tuple(pair_keys(scenario)[train.name] for train in by_departure),
        "seed": scenario.seed,
        "tick_s": scenario.tick_s,
    }


def limit_steps(track: Track, fastest_mps: float = FASTEST_MPS) -> list[tuple[float, float]]:
    """Speed limits of a track [m, m/s], from 0 on; none is above what its trains can run."""
    steps = track.limits_mps.part(0.0, track.length_m)
    return _changes([(at_m, min(limit_mps, fastest_mps)) for at_m, limit_mps in steps])


def _changes(steps: list[tuple[float, float]]) -> list[tuple[float, float]]:
    return [steps[0], *(after for before, after in pairwise(steps) if after[1] != before[1])]


def _restrictions(scenario: Scenario) -> dict[str, tuple[Any, ...]]:
    """Temporary speed restrictions as the zone controller is told of them."""
    tracks = list(scenario.network.tracks)
    faults = [each for each in scenario.faults if each.kind == "speed_restriction"]
    rows = [
        (
            tracks.index(fault.track),
            fault.from_m,
            fault.to_m,
            fault.speed_kmh / 3.6,
            fault.from_s,
            fault.to_s,
        )
        for fault in cast("list[Any]", faults)
    ]
    names = ("segments", "from_m", "to_m", "mps", "from_s", "to_s")
    columns = zip(*rows, strict=True) if rows else ((),) * len(names)
    return {f"restricted_{name}": tuple(each) for name, each in zip(names, columns, strict=True)}
