"""Whole runs over the two real lines, several trains one after the other."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rail_world.line.network import Network
from rail_world.line.ttobench import load_ttobench
from rail_world.trains.description import TrainDescription
from rail_world.trains.motion import TrainMotion


@pytest.mark.parametrize(
    ("line", "preset", "fastest_s", "slowest_s"),
    [
        # 22.7 km with 12 stands of 30 s: 1752 s is a commercial speed of 47 km/h.
        ("CN_Songjiazhuang_Yizhuang", "metro", 1600.0, 1900.0),
        # 29.6 km without a stop at 80 to 125 km/h.
        ("CH_StGallen_Wil", "regional", 950.0, 1080.0),
    ],
)
def test_trains_run_the_whole_line(
    real_line: Callable[[str], Path], line: str, preset: str, fastest_s: float, slowest_s: float
) -> None:
    network = Network({"main": load_ttobench(real_line(line))})
    track = network.tracks["main"]
    for direction in (1, -1):
        description = TrainDescription.model_validate(
            {
                "name": "t1",
                "route": ["main"],
                "direction": direction,
                "start_m": 0.0 if direction > 0 else track.length_m,
                "depart_s": 10.0,
                "vehicle": {"preset": preset},
            }
        )
        motion = TrainMotion(description, network, tick_s=0.1)
        length_m = motion.vehicle.length_m
        path, speed, stands = [], [], []
        state = motion.state
        while motion.state != "arrived" and motion.time_s < 5000.0:
            motion.step()
            path.append(motion.path_m)
            speed.append(motion.speed_mps)
            if motion.state != state and motion.state in ("dwelling", "arrived"):
                stands.append(motion.path_m)
            state = motion.state
        assert motion.state == "arrived"
        assert fastest_s < motion.time_s - 10.0 < slowest_s
        stops = track.stops_m[1:] if direction > 0 else track.stops_m[-2::-1]
        np.testing.assert_allclose(stands, stops, rtol=0, atol=1.0)
        assert motion.distance_m == pytest.approx(track.length_m)

        # Every point of the train keeps the limit of the line where that point is.
        path_m, speed_mps = np.array(path), np.array(speed)
        for part in np.linspace(0.0, 1.0, 9):
            limit = track.limit_mps(path_m - direction * part * length_m)
            assert np.max((np.abs(speed_mps) - limit) * 3.6) < 0.5
        # Position is the integral of speed, and no step accelerates beyond the train's means.
        moved = np.cumsum(0.1 * 0.5 * (speed_mps[1:] + speed_mps[:-1]))
        np.testing.assert_allclose(path_m[1:] - path_m[0], moved, atol=0.3)
        acceleration = direction * np.diff(speed_mps) / 0.1
        assert acceleration.max() < 1.2
        assert acceleration.min() > -motion.planned_deceleration_mps2 - 1e-6
