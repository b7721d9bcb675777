"""Every station of the built-in lines passed, there and back, by what a train would hear."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from rail_corridor.equipment.ranging.layout import layout_of
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import make_plan
from rail_corridor.scenario.model import Scenario
from rail_onboard.ranging.channel_selector import ChannelSelector
from rail_world.ranging.description import RadioDescription
from rail_world.ranging.medium import RadioMedium, TrainAntennas

C_MPS = 299_792_458.0
#: The channel must be that of the zone everywhere but this close to a station.
CHANGE_WITHIN_M = 8.0


class Line:
    """What a train hears, and should be tuned to, at every place of a route, 0.25 m apart."""

    def __init__(self, scenario: Scenario, route: tuple[str, ...], directory: Path) -> None:
        plan = make_plan(scenario, directory)
        radio = plan.world.part("ranging", RadioDescription)
        way = scenario.network.route(list(route), 1)
        self.path_m: NDArray[np.float64] = np.arange(1.0, way.length_m - 1.0, 0.25)
        pose = way.pose(self.path_m)
        count = len(self.path_m)
        place_m = np.stack((pose.x_m, pose.y_m, pose.z_m), axis=1)
        medium = RadioMedium(radio, plan.seed)
        paths = medium.paths(TrainAntennas(place_m, np.zeros((count, 3)), pose.heading_rad))
        stations = radio.stations
        carriers_hz = np.array([radio.carriers_hz[a.downlink_channel] for a in stations])
        loss_db = 20.0 * np.log10(4.0 * math.pi * carriers_hz / C_MPS)
        level_dbm = scenario.radio.wrs_power_dbm + paths.gain_db - loss_db[:, None]
        heard = paths.in_coverage & (level_dbm > 10.0 * math.log10(medium.noise_mw))
        channels = np.array([a.downlink_channel for a in stations])
        self.levels: list[dict[int, float]] = []
        for place in range(count):
            here: dict[int, float] = {}
            for row in np.flatnonzero(heard[:, place]):
                channel, dbm = int(channels[row]), float(level_dbm[row, place])
                here[channel] = max(here.get(channel, -math.inf), dbm)
            self.levels.append(here)
        zones = [layout_of(scenario).zone_at(*way.locate(float(path_m))) for path_m in self.path_m]
        self.zones = zones
        changes = [n for n in range(1, count) if zones[n] is not zones[n - 1]]
        self.stations_m = self.path_m[changes]
        self.entered = [zones[n].name for n in changes]
        self.pairs = {
            zone.downlink_channel: zone.uplink_channel for zone in layout_of(scenario).zones
        }

    def check(self, selector: ChannelSelector, places: Iterable[int]) -> int:
        """Move the train over these places; return how often it changed the channel."""
        changes, before = 0, selector.downlink
        for place in places:
            selector.update(self.levels[place])
            changes += selector.downlink != before
            before = selector.downlink
            path_m, zone = self.path_m[place], self.zones[place]
            if np.min(np.abs(self.stations_m - path_m)) > CHANGE_WITHIN_M:
                assert selector.downlink == zone.downlink_channel, (path_m, zone.name)
                assert selector.uplink == zone.uplink_channel
        return changes


ROUTES = [("plain_line", ("main",)), ("branch", ("main",)), ("branch", ("main", "branch"))]
ROUTES += [("demo", ("main",)), ("demo", ("main", "branch"))]


@pytest.fixture(scope="module", params=ROUTES, ids=lambda p: f"{p[0]}-{'-'.join(p[1])}")
def line(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Line:
    name, route = request.param
    return Line(load_scenario(name), route, tmp_path_factory.mktemp(name))


def test_the_channel_is_that_of_the_zone_there_and_back(line: Line) -> None:
    places = range(len(line.path_m))
    selector = ChannelSelector(line.pairs)
    # One change at every station and the first choice; as many back, but for the first.
    assert line.check(selector, places) == len(line.stations_m) + 1
    assert line.check(selector, reversed(places)) == len(line.stations_m)


def test_a_train_that_turns_back_anywhere_is_on_the_right_channel(line: Line) -> None:
    selector = ChannelSelector(line.pairs)
    ahead = 0
    while ahead + 200 < len(line.path_m):
        # 50 m on, 25 m back: every station is passed three times and turned back at.
        line.check(selector, range(ahead, ahead + 200))
        line.check(selector, range(ahead + 199, ahead + 99, -1))
        ahead += 100


def test_at_a_junction_the_pair_before_is_kept_until_one_leg_leads(tmp_path: Path) -> None:
    scenario = load_scenario("branch")
    for route, zone in ((("main",), "zone5"), (("main", "branch"), "zone7")):
        line = Line(scenario, route, tmp_path)
        before, after = layout_of(scenario).zone("zone4"), layout_of(scenario).zone(zone)
        selector = ChannelSelector(line.pairs)
        (junction_m,) = (m for m, n in zip(line.stations_m, line.entered, strict=True) if n == zone)
        used = {
            selector.update(levels)
            for path_m, levels in zip(line.path_m, line.levels, strict=True)
            if abs(path_m - junction_m) < 100.0
        }
        # The channel of the other leg is never used, not for a tick.
        assert used == {before.downlink_channel, after.downlink_channel}


def test_a_train_that_wakes_up_anywhere_chooses_its_zone_or_nothing(line: Line) -> None:
    for place in range(0, len(line.path_m), 7):
        distance_m = np.min(np.abs(line.stations_m - line.path_m[place]))
        chosen = ChannelSelector(line.pairs).update(line.levels[place])
        if chosen is not None and distance_m > CHANGE_WITHIN_M:
            assert chosen == line.zones[place].downlink_channel
