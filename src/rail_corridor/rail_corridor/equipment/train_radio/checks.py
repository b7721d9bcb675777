"""What train control by radio must agree on with the rest of a scenario."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Final

from rail_corridor.errors import InputError, did_you_mean
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.train_radio.movement_authority import FASTEST_MPS
from rail_onboard.braking_curve import corrected
from rail_onboard.train_radio.authority_curves import ReceivedAuthority
from rail_onboard.train_radio.train_location import Location
from rail_signals.train_radio.slots import RadioSlots
from rail_world.trains.description import VehicleDescription

from .keys import pair_keys
from .nodes import CONTROLLER, burst_format, curves_of, steepest_fall_permil
from .placement import bases_of
from .section import CBTC, CbtcPlan, ClockError, DeadBaseStation, NetworkThreats

#: Half-width of the interval of a front as ranges leave it [m].
_FIX_HALF_M: Final = 2.5


def _check_clocks(scenario: Scenario) -> None:
    """See that clocks that are wrong are there, and each wrong in one way at a time."""
    known = [CONTROLLER, *(f"/{train.name}/atp" for train in scenario.trains)]
    begun: set[tuple[str, float]] = set()
    for index, fault in enumerate(scenario.faults):
        if not isinstance(fault, ClockError):
            continue
        field = f"faults.{index}"
        if fault.node not in known:
            reason = f"no such unit has a clock of its own{did_you_mean(fault.node, known)}"
            raise InputError(reason, field=f"{field}.node", value=fault.node)
        if (fault.node, fault.from_s) in begun:
            reason = f"another fault of the clock of {fault.node} begins then"
            raise InputError(reason, field=f"{field}.from_s", value=fault.from_s)
        begun.add((fault.node, fault.from_s))


def check_cbtc(scenario: Scenario, train_fields: Sequence[str]) -> None:
    """Raise InputError for the first thing that does not fit train control by radio."""
    plan = CBTC.of(scenario)
    _check_faults(scenario)
    if plan is None:
        return
    if scenario.junctions:
        raise InputError(
            "train control by radio does not go with junctions yet",
            field="junctions.0.branch",
            value=scenario.junctions[0].branch,
        )
    period_s = max(plan.authority_period_s, scenario.tick_s)
    if plan.timeout_s < period_s + 2.0 * scenario.tick_s:
        raise InputError(
            f"is less than the period of authorities, {period_s:g} s, and two"
            f" ticks of {scenario.tick_s:g} s: trains would brake between two",
            field="cbtc.timeout_s",
            value=plan.timeout_s,
        )
    for index, (train, field) in enumerate(zip(scenario.trains, train_fields, strict=True)):
        reason = "trains with authorities by radio run towards increasing chainage only"
        if train.direction < 0:
            raise InputError(reason, field=f"{field}.direction", value=train.direction)
        if train.reverse_at:
            raise InputError(reason, field=f"{field}.reverse_at", value=len(train.reverse_at))
        _check_brakes(plan, train.vehicle, f"{field}.vehicle")
        _check_protection(scenario, plan, index + 1, field)
    _check_signal(scenario, plan)
    _check_clocks(scenario)
    pair_keys(scenario)
    for index, loss in enumerate(plan.losses):
        track = scenario.network.tracks.get(loss.track)
        if track is None:
            raise InputError(
                "there is no such track", field=f"cbtc.losses.{index}.track", value=loss.track
            )
        if loss.to_m > track.length_m:
            raise InputError(
                f"{loss.track} ends at {track.length_m:g} m",
                field=f"cbtc.losses.{index}.to_m",
                value=loss.to_m,
            )


def _check_brakes(plan: CbtcPlan, vehicle: VehicleDescription, field: str) -> None:
    """Refuse guaranteed rates above what the vehicle has with the factors."""
    service = [plan.braking_mps2, *(band.braking_mps2 for band in plan.brake_bands)]
    emergency = [plan.emergency_mps2, *(band.emergency_mps2 for band in plan.brake_bands)]
    factors = plan.brake_confidence, plan.brake_adhesion
    for name, counted in (
        ("max_service_brake_mps2", max(service)),
        ("emergency_brake_mps2", max(emergency)),
    ):
        rate = getattr(vehicle, name)
        ((_, least),) = corrected(((inf, rate),), *factors)
        if least < counted - 1e-9:
            raise InputError(
                f"is, times the factors {factors[0]:g} and {factors[1]:g}, weaker than the"
                f" {counted:g} m/s^2 that cbtc counts on",
                field=f"{field}.{name}",
                value=rate,
            )


def _check_protection(scenario: Scenario, plan: CbtcPlan, number: int, field: str) -> None:
    """Refuse a gradient that leaves too little of a brake, and a buffer too near to stop at."""
    train = scenario.trains[number - 1]
    track = scenario.network.tracks[train.route[0]]
    try:
        curves = curves_of(scenario, plan, number)
    except ValueError as error:
        fall_permil = steepest_fall_permil(track)
        if "too little" not in str(error):
            raise InputError(str(error), field=field, value=train.name) from None
        raise InputError(
            f"does not stop a train on the fall of {fall_permil:g} per mille of {train.route[0]}",
            field="cbtc.braking_mps2",
            value=plan.braking_mps2,
        ) from None
    if train.leaves_on_arrival:
        return
    end = ReceivedAuthority(0.0, track.length_m, FASTEST_MPS, overlap_m=plan.buffer_m, release=True)
    near = Location(track.length_m - _FIX_HALF_M, _FIX_HALF_M, True)
    if curves.at(end, near).release_mps <= 0.0:
        raise InputError(
            f"leaves no release speed to {train.name} at the end of {train.route[0]}: with its"
            f" brakes, on that gradient, the buffer is too near",
            field="cbtc.buffer_m",
            value=plan.buffer_m,
        )


def _check_signal(scenario: Scenario, plan: CbtcPlan) -> None:
    rate_hz = plan.symbol_rate_hz * plan.samples_per_symbol
    if plan.spacing_hz < rate_hz:
        raise InputError(
            f"is less than the {rate_hz:g} Hz that a channel takes up",
            field="cbtc.spacing_hz",
            value=plan.spacing_hz,
        )
    if plan.duplex_hz < plan.channels * plan.spacing_hz:
        raise InputError(
            f"is less than the {plan.channels * plan.spacing_hz:g} Hz of all channels",
            field="cbtc.duplex_hz",
            value=plan.duplex_hz,
        )
    slots = RadioSlots(burst_format(plan), len(scenario.trains))
    if slots.duration_s > scenario.tick_s:
        raise InputError(
            f"the slots of {len(scenario.trains)} trains last {slots.duration_s:g} s, longer than"
            f" a tick of {scenario.tick_s:g} s",
            field="cbtc.symbol_rate_hz",
            value=plan.symbol_rate_hz,
        )


def _check_faults(scenario: Scenario) -> None:
    bases = [base.name for base in bases_of(scenario)]
    for index, fault in enumerate(scenario.faults):
        if not isinstance(fault, DeadBaseStation | NetworkThreats | ClockError):
            continue
        if not bases:
            raise InputError(
                "goes with cbtc, of which there is none",
                field=f"faults.{index}.kind",
                value=fault.kind,
            )
        if isinstance(fault, DeadBaseStation) and fault.base not in bases:
            raise InputError(
                f"there is no such base station, they are {bases[0]} ... {bases[-1]}",
                field=f"faults.{index}.base",
                value=fault.base,
            )
