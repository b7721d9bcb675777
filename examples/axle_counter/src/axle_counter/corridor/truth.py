"""What is true of sections and detection points, from where the trains are."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from axle_counter.world.medium import path_on
from rail_corridor.scenario.model import Scenario
from rail_world.line.route import Route
from rail_world.trains.description import TrainDescription

from .placement import Span, layout_of
from .section import AxleCounterPlan


class AxlesOfTrain:
    """The axles of one train, and what lies on its way.

    Parameters
    ----------
    scenario : Scenario
    plan : AxleCounterPlan
    train : TrainDescription
    """

    def __init__(self, scenario: Scenario, plan: AxleCounterPlan, train: TrainDescription) -> None:
        self._layout = layout_of(scenario)
        self._clear_m = plan.sensor.clear_m
        self._axles_m = -train.direction * plan.cars.axles_m(train.vehicle.length_m)
        self.route = scenario.network.route(train.route, train.direction)
        self.start_m = self.route.path_of(train.route[0], train.start_m)

    def inside(self, path_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether an axle is in a section [tick, section]; ``path_m`` [tick], NaN if not there."""
        axles_m = path_m[:, None] + self._axles_m
        found = np.zeros((len(path_m), len(self._layout.sections)), dtype=bool)
        for index, section in enumerate(self._layout.sections):
            for span in section.spans:
                for low_m, high_m in _on_path(self.route, span):
                    found[:, index] |= ((axles_m > low_m) & (axles_m < high_m)).any(axis=1)
        return found

    def passed(self, path_m: NDArray[np.float64]) -> NDArray[np.int64]:
        """Axles that have passed each detection point forward and backward [point, way].

        An axle has passed when it has come from clear of the sensor on one side to clear of it on
        the other, as the sensor counts it.
        """
        counts = np.zeros((len(self._layout.points), 2), dtype=np.int64)
        axles_m = path_m[:, None] + self._axles_m
        for index, point in enumerate(self._layout.points):
            sensor_m = path_on(self.route, point.track, point.at_m)
            if sensor_m is None:
                continue
            side = np.where(axles_m > sensor_m + self._clear_m, 1, 0)
            side -= axles_m < sensor_m - self._clear_m
            for axle in side.T:
                turns = np.diff(axle[axle != 0])
                counts[index] += np.count_nonzero(turns > 0), np.count_nonzero(turns < 0)
        return counts


def _on_path(route: Route, span: Span) -> list[tuple[float, float]]:
    """The part of a span that a route passes, from and to along the route [m]."""
    return [
        (leg.path_start_m + span.start_m, leg.path_start_m + min(span.end_m, leg.end_m))
        for leg in route.legs
        if leg.track.name == span.track and span.start_m < leg.end_m
    ]


def empty_at_start(scenario: Scenario, plan: AxleCounterPlan) -> tuple[str, ...]:
    """Sections in which no axle of a train is when the run begins."""
    taken = np.zeros(len(layout_of(scenario).sections), dtype=bool)
    for train in scenario.trains:
        if not train.enters_at_departure:
            axles = AxlesOfTrain(scenario, plan, train)
            taken |= axles.inside(np.array([axles.start_m]))[0]
    names = (section.name for section in layout_of(scenario).sections)
    return tuple(name for name, is_taken in zip(names, taken, strict=True) if not is_taken)


def as_counts(values: Any) -> list[int]:
    """Sums of a record [tick, column] as whole numbers; what was not received counts nothing."""
    return [int(value) for value in np.nansum(values, axis=0)]
