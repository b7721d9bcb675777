"""A track with its reference stations, as the bounds of Doppler positions need it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rail_corridor.scenario.model import Scenario
from rail_msgs_py.doppler.quantities import RECEIVER_WALK
from rail_signals.arrays import FloatArray
from rail_signals.doppler.bound import position_bound_m, shift_information, tracked_bound_m
from rail_signals.doppler.bound import shift_variance_hz2 as variance_of_shifts_hz2
from rail_signals.doppler.surveyed_line import SurveyedLine
from rail_world.doppler.medium import ReferenceMedium

from .placement import Reference, references_of
from .section import REFERENCES, ReferencePlan
from .world import reference_description

_STEP_M = 5.0


@dataclass(frozen=True, eq=False)
class ReferencedTrack:
    """Line, stations and what is received of them along the track.

    ``chainage_m`` [points] are those of the line, ``places_m`` [stations, 3] the antennas.
    """

    plan: ReferencePlan
    line: SurveyedLine
    stations: tuple[Reference, ...]
    places_m: FloatArray
    medium: ReferenceMedium

    @classmethod
    def of(cls, scenario: Scenario, track: str) -> ReferencedTrack:
        """The track of a scenario; ValueError if that has no reference stations."""
        described, plan = reference_description(scenario), REFERENCES.of(scenario)
        if described is None or plan is None:
            raise ValueError(f"{scenario.name} has no reference stations")
        line = scenario.network.tracks[track]
        s = np.linspace(0.0, line.length_m, int(np.ceil(line.length_m / _STEP_M)) + 1)
        pose = line.pose(s)
        stations = tuple(one for one in references_of(scenario) if one.track == track)
        return cls(
            plan,
            SurveyedLine(s, pose.x_m, pose.y_m, pose.z_m, pose.heading_rad),
            stations,
            np.array([station.position_m for station in stations]),
            ReferenceMedium(described, scenario.network, scenario.seed),
        )

    def variance_hz2(self, chainage_m: FloatArray) -> FloatArray:
        """Variance of the shifts [points, stations] [Hz^2]: noise, and the station's oscillator."""
        distance = self.line.distances(self.places_m, chainage_m)
        snr = self.medium.snr(distance, 10.0 ** (self.plan.power_dbm / 10.0))
        own_hz = 1e-9 * self.plan.station_ppb * self.plan.carrier_hz
        return variance_of_shifts_hz2(self.plan.tones, snr) + own_hz**2

    def bound_m(self, chainage_m: FloatArray, speed_mps: float) -> FloatArray:
        """Bound of the position of a single block [points] [m]."""
        return position_bound_m(
            self.plan.tones,
            self.line,
            self.places_m,
            chainage_m,
            speed_mps,
            self.variance_hz2(chainage_m),
            coverage_range_m=self.plan.coverage_range_m,
            offset_sigma_hz=self._offset_hz,
            speed_sigma_mps=self._speed_mps,
        )

    def run_bound_m(
        self,
        chainage_m: FloatArray,
        speed_mps: FloatArray,
        available: NDArray[np.bool_],
        step_s: float,
    ) -> FloatArray:
        """Bound of the positions of a run [blocks] [m], as a positioner makes them.

        It carries the offset on from each block that has `available` a position to the next,
        `step_s` later, and nothing else.
        """
        information = shift_information(
            self.plan.tones,
            self.line,
            self.places_m,
            chainage_m,
            speed_mps,
            self.variance_hz2(chainage_m),
            coverage_range_m=self.plan.coverage_range_m,
        )
        return tracked_bound_m(
            information,
            available,
            offset_sigma_hz=self._offset_hz,
            walk_hz=RECEIVER_WALK.default * step_s**0.5,
            speed_sigma_mps=self._speed_mps,
        )

    @property
    def _offset_hz(self) -> float:
        return 1e-6 * self.plan.receiver_ppm * self.plan.carrier_hz or 1e-6

    @property
    def _speed_mps(self) -> float:
        return 2.0 * self.plan.tones.max_speed_mps
