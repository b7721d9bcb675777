"""What a viewer makes of the messages of a corridor, and of a corridor that comes and goes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import serialize_message
from std_msgs.msg import Header, String

from rail_corridor.equipment.ranging.layout import layout_of
from rail_corridor.loading.loader import load_scenario
from rail_corridor.loading.schema import parse_scenario
from rail_corridor.plan.announcement import announcement
from rail_corridor.scenario.model import Scenario
from rail_corridor.view.frame import Asked, Lists, frame
from rail_corridor.view.live_state import STILL_S, LiveStateStore
from rail_corridor.view.sensors import cards
from rail_msgs_py.failures import failure
from rail_msgs_py.position import Position
from rail_msgs_py.ranging.range_reading import RangeWriter
from rail_msgs_py.stamps import to_time
from rail_msgs_py.table import TableWriter
from rail_msgs_py.topics.ranging import POSITION, RANGE
from rail_msgs_py.topics.tick import DIAGNOSTICS, FAILED, FINISHED
from rail_msgs_py.topics.track_code import CODE_RECEIVED
from rail_msgs_py.topics.world import COMMAND, CORRIDOR_PATH, SCENARIO, STATE
from rail_msgs_py.waveform import Waveform
from rail_world.line.corridor_map import path_of

TICK_NS = 250_000_000


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("demo")


class Corridor:
    """Feeds a live state with what the corridor of a scenario would send."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.state = LiveStateStore()
        self.wall_s = 100.0
        self.names = tuple(train.name for train in scenario.trains)
        self.writers = 1

    def announce(self) -> None:
        self.feed(SCENARIO.name(), String(data=announcement(self.scenario)))

    def tick(
        self,
        tick: int,
        places: dict[str, tuple[int, float]],
        said: dict[str, tuple[str, float, float]] | None = None,
    ) -> None:
        """Send the truth (track index, chainage) and positions (track, chainage, variance)."""
        state = np.zeros((len(self.names), len(STATE.columns)))
        for name, (track, chainage_m) in places.items():
            row = state[self.names.index(name)]
            row[[5, 7, 8, 9]] = (20.0, track, chainage_m, 1.0)
        writer = TableWriter(self.names, STATE.columns)
        self.feed("/world/state", writer.write(tick * TICK_NS, state))
        for name, (track, chainage_m, variance) in (said or {}).items():
            position = Position(tick * TICK_NS, name, track, chainage_m, variance, 19.0, 0.1)
            self.feed(POSITION.name(train=name), position.to_cdr())
        self.state.look(writers=self.writers)
        self.wall_s += 0.25

    def table(self, name: str, columns: tuple[str, ...], *values: float, tick: int = 4) -> None:
        writer = TableWriter((name.split("/")[1],), columns)
        self.feed(name, writer.write(tick * TICK_NS, np.array([values], dtype=float)))

    def feed(self, name: str, message: Any) -> None:
        raw = message if isinstance(message, bytes) else serialize_message(message)
        self.state.feed(name, raw, self.wall_s)

    def frame(self, **asked: Any) -> dict[str, Any]:
        return frame(self.state, Asked(**asked), Lists(), lambda _: self.writers, self.wall_s)

    def status(self) -> str:
        return self.state.status(self.wall_s)


@pytest.fixture
def corridor(scenario: Scenario) -> Corridor:
    return Corridor(scenario)


PLACES = {"train_a": (0, 1600.0), "train_b": (1, 300.0)}


def test_the_error_is_held_against_the_truth_of_the_same_tick(corridor: Corridor) -> None:
    corridor.announce()
    corridor.tick(3, {"train_a": (0, 1595.0)}, {"train_a": ("main", 1595.2, 0.04)})
    # The next tick's truth is there, its position is not yet: 5 m further on.
    corridor.tick(4, {"train_a": (0, 1600.0)})
    (train, *_) = corridor.frame()["trains"]
    assert train["error_m"] == pytest.approx(0.2)
    assert train["sigma_m"] == pytest.approx(0.2)
    assert train["true"] == ["main", 1595.0]
    assert train["age_s"] == pytest.approx(0.25)


def test_an_error_across_tracks_is_not_made_up(corridor: Corridor) -> None:
    corridor.announce()
    corridor.tick(4, PLACES, {"train_b": ("main", 1720.0, 0.04), "train_a": ("main", 1.0, np.inf)})
    first, second, third = corridor.frame()["trains"]
    assert (second["error_m"], second["known"], second["true"]) == (None, True, ["branch", 300.0])
    assert (first["error_m"], first["known"], first["sigma_m"]) == (None, False, None)
    assert third["on"] is False
    (row,) = corridor.frame()["history"]["rows"]
    assert row == [1.0, ["main", None, None, 1600.0], ["main", 1720.0, 0.2, None], None]


def test_a_corridor_is_waited_for_followed_and_seen_to_end(corridor: Corridor) -> None:
    assert corridor.status() == "waiting"
    corridor.announce()
    assert corridor.status() == "starting"
    corridor.tick(0, PLACES)
    assert (corridor.status(), corridor.state.ticking) == ("running", False)
    corridor.tick(1, PLACES)
    assert (corridor.status(), corridor.state.ticking) == ("running", True)
    corridor.wall_s += STILL_S + 1.0
    assert corridor.status() == "still"
    corridor.tick(2, PLACES)
    header = Header()
    for key, value in to_time(2 * TICK_NS).items():
        setattr(header.stamp, key, value)
    corridor.feed(FINISHED.name(), header)
    assert (corridor.status(), corridor.state.ticking) == ("ended", False)
    corridor.state.look(writers=0)
    assert corridor.status() == "ended"


def test_a_corridor_that_is_killed_is_gone_and_the_next_one_is_followed(corridor: Corridor) -> None:
    corridor.announce()
    for tick in range(9):
        corridor.tick(tick, PLACES, {"train_a": ("main", 1600.0, 0.04)})
    array = DiagnosticArray(status=[DiagnosticStatus(level=b"\x01", name="/a: x", message="m")])
    corridor.feed(DIAGNOSTICS.name(), array)
    before = corridor.frame()
    assert len(before["history"]["rows"]) == 5
    corridor.state.look(writers=0)
    assert corridor.status() == "gone"
    assert corridor.frame()["counts"]["warn"] == 1
    # What the next corridor says first begins it, and what was of the last one is forgotten.
    corridor.announce()
    after = corridor.frame(run=before["run"], generation=before["history"]["generation"], rows=5)
    assert corridor.status() == "starting"
    assert after["run"] != before["run"]
    assert "line" in after
    assert after["history"] == {
        "generation": after["history"]["generation"],
        "begin": 0,
        "rows": [],
    }
    assert after["history"]["generation"] != before["history"]["generation"]
    assert after["counts"]["warn"] == 0
    assert after["trains"] == []


def test_time_that_runs_back_begins_a_new_run(corridor: Corridor) -> None:
    corridor.announce()
    corridor.tick(40, PLACES)
    corridor.tick(0, PLACES)
    assert [row[0] for row in corridor.state.history.rows] == [0.0]
    assert corridor.state.line["name"] == "demo"


def test_only_what_is_new_is_sent(corridor: Corridor) -> None:
    corridor.announce()
    corridor.tick(4, PLACES)
    first = corridor.frame()
    assert {"line", "history", "lists"} <= set(first)
    again = corridor.frame(
        run=first["run"], generation=first["history"]["generation"], rows=1, lists=0
    )
    assert {"line", "lists", "cards", "health", "telegrams", "scope"}.isdisjoint(again)
    assert again["history"]["rows"] == []


def test_the_line_is_that_of_the_scenario(corridor: Corridor) -> None:
    for name, track in corridor.scenario.network.tracks.items():
        corridor.feed(CORRIDOR_PATH.name(track=name), path_of(track))
    corridor.announce()
    line = corridor.frame()["line"]
    branch = next(track for track in line["tracks"] if track["name"] == "branch")
    assert (branch["from"], branch["from_m"], branch["length_m"]) == ("main", 1420.0, 900.0)
    zones = layout_of(corridor.scenario).zones
    assert [(z["name"], z["downlink"], z["uplink"]) for z in line["zones"]] == [
        (zone.name, zone.downlink_channel, zone.uplink_channel) for zone in zones
    ]
    share, x_m, y_m = line["paths"]["branch"][-1]
    pose = corridor.scenario.network.tracks["branch"].pose(900.0)
    assert (share, x_m, y_m) == (1.0, round(float(pose.x_m), 1), round(float(pose.y_m), 1))


def test_an_announcement_of_another_version_is_passed_over(corridor: Corridor) -> None:
    for text in ("", "no json", '{"bursts": {"scheme": "other"}}'):
        corridor.feed(SCENARIO.name(), String(data=text))
    corridor.tick(4, PLACES, {"train_a": ("main", 1600.5, 0.04)})
    (train, *_) = corridor.frame()["trains"]
    assert train["error_m"] == pytest.approx(0.5)


def test_without_an_announcement_the_line_is_drawn_from_its_paths(corridor: Corridor) -> None:
    track = corridor.scenario.network.tracks["branch"]
    corridor.feed(CORRIDOR_PATH.name(track="branch"), path_of(track))
    (drawn,) = corridor.frame()["line"]["tracks"]
    assert drawn["name"] == "branch"
    assert drawn["length_m"] == pytest.approx(900.0, rel=1e-3)


def test_a_slow_corridor_does_not_stand_still(corridor: Corridor) -> None:
    corridor.announce()
    for tick in range(5):
        corridor.wall_s += 4.0
        corridor.tick(tick, PLACES)
    assert corridor.state.rate() == pytest.approx(0.25 / 4.25, rel=0.01)
    corridor.wall_s += 8.0
    assert corridor.status() == "running"
    corridor.wall_s += 20.0
    assert corridor.status() == "still"


def test_cards_of_known_and_unknown_sensors(corridor: Corridor) -> None:
    corridor.announce()
    corridor.tick(4, PLACES, {"train_a": ("main", 1600.3, 0.04)})
    corridor.table("/train_a/vrs/channel", ("downlink", "uplink", "level_1_dbm"), 1, 2, -61.5)
    corridor.table("/train_a/radar/fix", ("chainage_m", "sigma_m", "loop_gain"), 1599.0, 0.4, 7.0)
    corridor.table("/train_a/track_code/message", CODE_RECEIVED.columns, *[math.nan] * 8)
    zone = layout_of(corridor.scenario).zone_at("main", 1600.0)
    name = RANGE.name(site=zone.station, zone=zone.name)
    corridor.feed(name, RangeWriter(zone.name, 0.0, 400.0).write(4 * TICK_NS, 55.5, 0.01))
    made = {card["topic"]: card for card in cards(corridor.state, "train_a", lambda _: 1)}
    ranging = made["/wayside/zone_controller/train_a/position"]
    assert ranging["gauge"] == {"off_m": 0.3, "half_m": 0.4, "what": "2σ"}
    assert made[name]["rows"] == [["range", "55.50 ± 0.10", "m"]]
    assert made["/train_a/vrs/channel"]["rows"] == [
        ["in force", "CH1 / CH2", ""],
        ["heard on CH1", "−61.5", "dBm"],
    ]
    stranger = made["/train_a/radar/fix"]
    assert stranger["title"] == "radar fix"
    assert ["loop gain", "7", ""] in stranger["rows"]
    assert stranger["gauge"] == {"off_m": -1.0, "half_m": 0.8, "what": "2σ"}
    assert made["/train_a/track_code/message"]["rows"] == [["code", "none that can be read", ""]]
    assert {card["state"] for card in made.values()} == {"ok"}


@pytest.mark.parametrize(
    ("demands", "shown"),
    [
        ((0, 0, 0), ""),
        ((1, 0, 0), "warning"),
        ((1, 1, 0), "service_brake"),
        ((1, 1, 1), "emergency_brake"),
    ],
)
def test_the_strongest_brake_is_shown(
    corridor: Corridor, demands: tuple[int, int, int], shown: str
) -> None:
    corridor.tick(4, PLACES)
    topic = COMMAND.name(train="train_a", supervision="atp")
    corridor.table(topic, COMMAND.columns, 20.0, *demands, 0, 0)
    train = corridor.frame()["trains"][0]
    assert (train["permitted_kmh"], train["brake"]) == (72.0, shown)


def test_a_topic_that_vanishes_is_stale_and_then_gone(corridor: Corridor) -> None:
    corridor.announce()
    corridor.tick(4, PLACES)
    corridor.table("/train_a/vrs/channel", ("downlink", "uplink"), 1, 2)
    for tick in range(5, 30):
        corridor.tick(tick, PLACES)
    (card,) = corridor.frame(train="train_a")["cards"]
    assert (card["state"], card["age_s"]) == ("stale", 6.25)
    corridor.writers = 0
    (card,) = corridor.frame(train="train_a")["cards"]
    assert card["state"] == "gone"


def test_failed_nodes_and_switched_off_ones_are_told_apart(corridor: Corridor) -> None:
    corridor.tick(0, PLACES)
    corridor.feed(FAILED.name(), failure("/wayside/wrs3", "no answer", "/world"))
    for level, message in ((b"\x00", "switched on"), (b"\x01", "switched off")):
        status = DiagnosticStatus(level=level, name="/wayside/wrs4: equipment", message=message)
        corridor.feed(DIAGNOSTICS.name(), DiagnosticArray(status=[status]))
    lists = Lists(1, (), ("/wayside/wrs3", "/wayside/wrs4", "/wayside/wrs5"))
    found = frame(corridor.state, Asked(tab="health"), lists, lambda _: 1, corridor.wall_s)
    assert found["off"] == ["/wayside/wrs4"]
    assert found["failed"] == ["/wayside/wrs3"]
    assert found["health"]["failed"][0]["by"] == "/world"
    assert [e["text"] for e in found["health"]["events"]] == ["switched off", "given up: no answer"]


def test_the_scope_says_what_it_cannot_show(corridor: Corridor) -> None:
    corridor.tick(4, PLACES)
    wave = Waveform(TICK_NS, 4e6, 2.4e9, 1, np.full((1, 16), 0.1 + 0j))
    corridor.feed("/train_a/vrs/tx", wave.to_cdr())
    corridor.feed("/train_a/stranger/tx", wave.to_cdr())
    corridor.table("/train_a/vrs/channel", ("downlink", "uplink"), 1, 2)
    for topic in ("/train_a/vrs/tx", "/train_a/stranger/tx"):
        shown = corridor.frame(tab="scope", scope=topic)["scope"]
        assert shown["power_dbm"] == pytest.approx(-20.0)
    for topic, problem in (("/train_a/vrs/channel", "table"), ("/nothing", "nothing received")):
        assert problem in corridor.frame(tab="scope", scope=topic)["scope"]["problem"]


@pytest.mark.parametrize(
    "name",
    ["demo", "follow_codes", "moving_block", "branch", "hostile_network", "located_block"],
)
def test_every_scenario_announces_itself(name: str) -> None:
    corridor = Corridor(load_scenario(name))
    corridor.announce()
    line = corridor.state.line
    assert line["name"] == name
    assert [train["name"] for train in line["trains"]] == list(corridor.names)
    assert parse_scenario(line["scenario"]).to_json() == corridor.scenario.to_json()
    assert all(fault["subject"] for fault in line["faults"])
    # The page needs what follows from it alone.
    assert "scenario" not in corridor.frame()["line"]
