"""The medium: every sample once, in its place; the same noise whoever asks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from axle_counter.signals.axles import Cars
from axle_counter.signals.wheel_sensor import WheelSensor
from axle_counter.world.description import SensorPlace, WheelSensorDescription
from axle_counter.world.medium import Motion, WheelSensorMedium, path_on
from builders import straight, train
from pydantic import ValidationError

from rail_world.line.network import Network

TICK_S = 0.1
RATE_HZ = 8000.0


def described(**changes: Any) -> WheelSensorDescription:
    fields: dict[str, Any] = {
        "sensor": WheelSensor(),
        "places": (SensorPlace(point="dp1", track="main", at_m=500.0),),
        "cars": Cars(),
        "sample_rate_hz": RATE_HZ,
        "noise_v": 0.0,
    }
    return WheelSensorDescription(**{**fields, **changes})


def medium(network: Network, tick_s: float = TICK_S, seed: int = 1, **changes: Any) -> Any:
    return WheelSensorMedium(described(**changes), [train()], network, seed, tick_s)


def motions(path_m: float, speed_mps: float = 0.0, *, on_line: bool = True) -> list[Motion]:
    return [Motion(path_m, speed_mps, on_line)]


def test_blocks_follow_each_other_without_a_gap_whatever_the_tick(network: Network) -> None:
    """An accelerated train: ticks of any length give the samples of the closed form."""
    sensor, axles_m = WheelSensor(), Cars().axles_m(60.0)

    def path(time_s: Any) -> Any:
        return 495.0 + 3.0 * time_s + 0.5 * 1.2 * time_s**2

    for tick_s in (0.05, 0.1, 0.25):
        made, ticks = medium(network, tick_s), round(4.0 / tick_s)
        times_s = [tick * tick_s for tick in range(ticks + 1)]
        blocks = [
            made.blocks(tick, motions(path(t), 3.0 + 1.2 * t)) for tick, t in enumerate(times_s)
        ]
        samples = np.concatenate([block[0] for block in blocks[1:]], axis=1)
        count = round(RATE_HZ * tick_s * ticks)
        wheel_m = path(np.arange(1, count + 1) / RATE_HZ)[:, None] - axles_m - 500.0
        for coil, at_m in enumerate(sensor.coils_m):
            expected = sensor.rest_v - sensor.dip_v(wheel_m - at_m).sum(axis=1)
            assert samples[coil] == pytest.approx(expected, abs=1e-9)
        assert samples.min() < 0.51  # wheels were over it


def test_the_first_block_shows_what_stands_on_the_sensor(network: Network) -> None:
    axle_m = float(Cars().axles_m(60.0)[0])
    (block,) = medium(network).blocks(0, motions(500.0 + axle_m - 0.075, 20.0))
    assert block[0] == pytest.approx(np.full(800, 0.5))  # over the first coil
    assert block[1] == pytest.approx(np.full(800, 1.0 - WheelSensor().dip_v(0.15)))


def test_a_train_that_has_left_damps_nothing_and_one_that_comes_does_not_jump(
    network: Network,
) -> None:
    made = medium(network)
    front_m = 500.0 + float(Cars().axles_m(60.0)[0])
    made.blocks(0, motions(front_m))
    (gone,) = made.blocks(1, motions(front_m, on_line=False))
    assert gone.min() == gone.max() == 1.0
    (back,) = made.blocks(2, motions(front_m))
    assert np.ptp(back, axis=1) == pytest.approx([0.0, 0.0])


def test_noise_has_its_size_and_depends_on_seed_sensor_and_tick_alone(network: Network) -> None:
    places = tuple(
        SensorPlace(point=f"dp{number}", track="main", at_m=100.0 * number) for number in (1, 2)
    )
    common = {"places": places, "noise_v": 0.01}
    far = motions(5.0)
    blocks = medium(network, **common).blocks(7, far)
    assert blocks.std() == pytest.approx(0.01, rel=0.05)
    assert blocks.mean() == pytest.approx(1.0, abs=1e-3)
    assert np.array_equal(blocks, medium(network, **common).blocks(7, far))
    one = medium(network, noise_v=0.01, places=places[:1]).blocks(7, far)
    assert np.array_equal(one[0], blocks[0])  # other sensors change nothing
    others = (
        medium(network, **common).blocks(8, far)[0],
        medium(network, seed=2, **common).blocks(7, far)[0],
        blocks[1],
    )
    for other in (*others, blocks[0][::-1]):
        assert abs(np.corrcoef((blocks[0] - 1.0).ravel(), (other - 1.0).ravel())[0, 1]) < 0.1


def test_a_point_is_on_the_path_of_those_trains_that_pass_it() -> None:
    route = straight(1000.0).route(["main"])
    assert path_on(route, "main", 250.0) == 250.0
    assert path_on(route, "main", 1001.0) is None
    assert path_on(route, "branch", 250.0) is None


def test_wrong_descriptions_are_refused(network: Network) -> None:
    with pytest.raises(ValueError, match="whole number of samples"):
        medium(network, sample_rate_hz=8001.0)
    place = SensorPlace(point="dp1", track="main", at_m=1.0)
    with pytest.raises(ValidationError, match="twice"):
        described(places=(place, place))
    with pytest.raises(ValidationError, match="no point dp9"):
        described(missed_axles=({"point": "dp9", "from_s": 0, "to_s": 1, "every": 1, "left": 0},))
