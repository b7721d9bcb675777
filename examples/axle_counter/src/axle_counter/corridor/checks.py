"""What axle counters must agree on with the rest of a scenario."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rail_corridor.errors import InputError
from rail_corridor.scenario.model import Scenario
from rail_world.line.description_base import whole_samples

from .placement import layout_of
from .section import AXLE_COUNTERS, AxleCounterPlan, MissedAxles, RailBrake
from .truth import AxlesOfTrain

#: A sensor is at least this far from points, where it could not be on one track alone [m].
_FROM_JUNCTION_M = 5.0


def check_axle_counters(scenario: Scenario, train_fields: Sequence[str]) -> None:
    """Raise InputError for the first thing that does not fit."""
    _check_faults(scenario)
    plan = AXLE_COUNTERS.of(scenario)
    if plan is None:
        return
    _check_tracks(scenario, plan)
    _check_speed(scenario, plan)
    try:
        whole_samples(plan.sample_rate_hz, scenario.tick_s)
    except ValueError:
        raise InputError(
            f"a tick of {scenario.tick_s:g} s is no whole number of samples",
            field="axle_counters.sample_rate_hz",
            value=plan.sample_rate_hz,
        ) from None
    names = [section.name for section in layout_of(scenario).sections]
    for index, reset in enumerate(plan.resets):
        if reset.section not in names:
            raise InputError(
                f"there is no such section, they are {', '.join(names)}",
                field=f"axle_counters.resets.{index}.section",
                value=reset.section,
            )
    for train, field in zip(scenario.trains, train_fields, strict=True):
        axles = AxlesOfTrain(scenario, plan, train)
        if train.enters_at_departure and axles.inside(np.array([axles.start_m])).any():
            raise InputError(
                "the train would appear in a section whose axles are counted",
                field=f"{field}.start_m",
                value=train.start_m,
            )


def _check_tracks(scenario: Scenario, plan: AxleCounterPlan) -> None:
    for name, track in scenario.network.tracks.items():
        if track.length_m <= 2.0 * plan.margin_m:
            raise InputError(
                f"leaves nothing of {name}, which is {track.length_m:g} m long",
                field="axle_counters.margin_m",
                value=plan.margin_m,
            )
    for point in layout_of(scenario).points:
        for junction in scenario.network.junctions_on(point.track):
            if abs(junction.at_m - point.at_m) < _FROM_JUNCTION_M:
                raise InputError(
                    f"puts {point.name} on the points at {junction.at_m:g} m of {point.track}",
                    field="axle_counters.length_m",
                    value=plan.length_m,
                )


def _check_speed(scenario: Scenario, plan: AxleCounterPlan) -> None:
    top_mps = plan.sensor.top_speed_mps(plan.sample_rate_hz, plan.cars.axle_distance_m)
    for train in scenario.trains:
        if train.vehicle.max_speed_kmh > 3.6 * top_mps:
            raise InputError(
                f"tells axles apart up to {3.6 * top_mps:.0f} km/h,"
                f" but {train.name} runs {train.vehicle.max_speed_kmh:g} km/h",
                field="axle_counters.sample_rate_hz",
                value=plan.sample_rate_hz,
            )


def _check_faults(scenario: Scenario) -> None:
    points = [point.name for point in layout_of(scenario).points]
    trains = [train.name for train in scenario.trains]
    for index, fault in enumerate(scenario.faults):
        for kind, name, known, what in (
            (MissedAxles, "point", points, "detection point"),
            (RailBrake, "train", trains, "train"),
        ):
            if isinstance(fault, kind) and getattr(fault, name) not in known:
                raise InputError(
                    f"there is no such {what}",
                    field=f"faults.{index}.{name}",
                    value=getattr(fault, name),
                )
