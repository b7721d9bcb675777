"""What train control by radio must agree on with the rest of a scenario."""

from __future__ import annotations

from collections.abc import Sequence

from rail_corridor.errors import InputError, did_you_mean
from rail_corridor.scenario.model import Scenario
from rail_signals.track_code.scales import LEAST_BRAKING_MPS2, deceleration_mps2
from rail_signals.train_radio.slots import RadioSlots

from .keys import pair_keys
from .nodes import CONTROLLER, burst_format, steepest_fall_permil
from .placement import bases_of
from .section import CBTC, CbtcPlan, ClockError, DeadBaseStation, NetworkThreats


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
    for train, field in zip(scenario.trains, train_fields, strict=True):
        reason = "trains with authorities by radio run towards increasing chainage only"
        if train.direction < 0:
            raise InputError(reason, field=f"{field}.direction", value=train.direction)
        if train.reverse_at:
            raise InputError(reason, field=f"{field}.reverse_at", value=len(train.reverse_at))
        for name, counted in (
            ("max_service_brake_mps2", plan.braking_mps2),
            ("emergency_brake_mps2", plan.emergency_mps2),
        ):
            if getattr(train.vehicle, name) < counted:
                raise InputError(
                    f"is weaker than the {counted:g} m/s^2 that cbtc counts on",
                    field=f"{field}.vehicle.{name}",
                    value=getattr(train.vehicle, name),
                )
    _check_braking(scenario, plan)
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


def _check_braking(scenario: Scenario, plan: CbtcPlan) -> None:
    """See that what is left of the guaranteed brake stops a train on the steepest fall."""
    for name, track in scenario.network.tracks.items():
        fall_permil = steepest_fall_permil(track)
        left_mps2 = deceleration_mps2(plan.braking_mps2, -fall_permil)
        if left_mps2 < LEAST_BRAKING_MPS2:
            raise InputError(
                f"does not stop a train on the fall of {fall_permil:g} per mille of {name}",
                field="cbtc.braking_mps2",
                value=plan.braking_mps2,
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
