"""Equipment of another distribution on the live page: no file of the page knows it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from std_msgs.msg import Float64MultiArray, String, UInt8MultiArray

from rail_corridor.equipment import registry
from rail_corridor.equipment.live import LiveView
from rail_corridor.equipment.live_elements import (
    CardGroup,
    ElementState,
    ErrorTrace,
    LineRow,
    LogEntry,
    Mark,
    Panel,
    PanelSpec,
    TableCard,
    TrackStretch,
    TrainCell,
    TrainColumn,
    TrainInterval,
    TrainRow,
    Writers,
)
from rail_corridor.equipment.live_state import LiveState
from rail_corridor.equipment.subsystem import Subsystem
from rail_corridor.view import sensors, wanted
from rail_corridor.view.frame import Asked, Lists, frame
from rail_corridor.view.live_state import LiveStateStore
from rail_corridor.view.wanted import ARRAY, Wish
from rail_msgs_py.table import Table, TableWriter
from rail_msgs_py.topics.column import Column
from rail_msgs_py.topics.qos import ESTIMATE, STREAM
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.world import SCENARIO, STATE

TRAIN = "first"
AXLES = Topic(
    *("/wayside/{section}/axle_counter/occupancy", Float64MultiArray, ESTIMATE, Table),
    *("axle_counter", "people", "Axles in a section."),
    table=(Column("axles", "number of axles in the section"),),
)
COUNTED = Topic(
    *("/{train}/axle_counter/count", Float64MultiArray, ESTIMATE, Table),
    *("axle_counter", "people", "Axles of a train."),
    table=(Column("axles", "number of axles"), Column("front_m", "of the train")),
)
PULSES = Topic(
    *("/wayside/{head}/axle_counter/pulses", UInt8MultiArray, STREAM, None),
    *("wheel_sensor", "axle_counter", "Pulses."),
)
LINE = {
    "tick_s": 0.25,
    "tracks": [{"name": "main", "length_m": 900.0, "from": None, "from_m": 0.0}],
    "trains": [{"name": TRAIN, "length_m": 100.0, "direction": 1, "route": ["main"]}],
    "axle_sections": [{"name": "s1", "track": "main", "start_m": 0.0, "end_m": 400.0}],
    "wheel_sensors": [{"name": "h1", "track": "main", "at_m": 400.0}],
}


class AxleCounterView(LiveView):
    """What a plug-in shows; each hook once."""

    overview = (AXLES,)
    events = (PULSES,)
    panel = PanelSpec("axles", "Axles", "There is no axle counter.")
    columns = (TrainColumn("axles", "axles"),)
    error_trace = ErrorTrace("axle counter", "Error of the axle counter.")
    tables = (
        TableCard(
            COUNTED,
            "Axle counter",
            CardGroup.RECEPTION,
            lambda _state, _train, row: [["axles", f"{row['axles']:.0f}", ""]],
        ),
    )

    def line_rows(self, line: Mapping[str, Any]) -> Sequence[LineRow]:
        return (
            LineRow(
                "axle sections",
                "section occupied",
                tuple(
                    Mark(each["name"], each["track"], each["at_m"])
                    for each in line.get("wheel_sensors", ())
                ),
                tuple(
                    TrackStretch(each["name"], each["track"], each["start_m"], each["end_m"])
                    for each in line.get("axle_sections", ())
                ),
                "square",
            ),
        )

    def states(self, state: LiveState) -> Mapping[str, Mapping[str, ElementState]]:
        axles = state.row(AXLES.name(section="s1")).get("axles", 0.0)
        shown = {"s1": ElementState("occupied")} if axles > 0.0 else {}
        return {"axle sections": shown | {"h1": ElementState("miscounts", tone="bad")}}

    def train_row(self, state: LiveState, train: str, writers: Writers) -> TrainRow:
        row = state.row(COUNTED.name(train=train))
        if not row:
            return TrainRow()
        front_m = row["front_m"]
        interval = TrainInterval("main", front_m - 1.0, front_m + 1.0, "section of the train")
        return TrainRow({"axles": TrainCell(f"{row['axles']:.0f}", "warned")}, interval)

    def error(self, state: LiveState, train: str) -> tuple[float, float, float] | None:
        row, true = state.row(COUNTED.name(train=train)), state.true_place(train, state.now_ns)
        if not row or true is None:
            return None
        error_m = row["front_m"] - true[1]
        return error_m, error_m - 1.0, error_m + 1.0

    def panel_contents(self, state: LiveState, train: str) -> Panel | None:
        if not state.line.get("axle_sections"):
            return None
        rows = ((("s1", ""), ("2", "axles")),)
        return Panel(train, (), "Sections", (("section", ""), ("in", "")), rows, (True,))

    def log_entries(self, line: Mapping[str, Any], name: str, raw: bytes) -> Sequence[LogEntry]:
        return (LogEntry(1.0, "pulse", "h1", "wheel", "counter", "edge", len(raw), "in"),)


class AxleCounter(Subsystem):
    """Equipment of another distribution."""

    name = "axle_counter"
    topics = (AXLES, COUNTED, PULSES)

    def live(self) -> LiveView:
        return AxleCounterView()


class Entry:
    """Its entry point."""

    name = "axle_counter"
    value = "rail_axle_counter:AXLE_COUNTER"

    def load(self) -> Subsystem:
        return AxleCounter()


CACHED = (
    *(registry.subsystems, registry.node_kinds, registry.topics, registry.live_views),
    *(wanted.overview, wanted.events, wanted.kind_of, wanted.of_train, sensors.table_cards),
)


@pytest.fixture(autouse=True)
def _plugged_in() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(registry, "entry_points", lambda group: [Entry()])
        for cached in CACHED:
            cached.cache_clear()
        yield
    for cached in CACHED:
        cached.cache_clear()


@pytest.fixture
def state() -> LiveStateStore:
    made = LiveStateStore()
    raw: bytes = serialize_message(String(data=json.dumps(LINE)))
    made.feed(SCENARIO.name(), raw, 0.0)
    row = [0.0] * len(STATE.columns)
    row[STATE.index["on_line"]], row[STATE.index["chainage_m"]] = 1.0, 200.0
    made.feed(STATE.name(), TableWriter((TRAIN,), STATE.columns).write(0, np.array([row])), 0.0)
    counted = TableWriter((TRAIN,), COUNTED.columns).write(0, np.array([[8.0, 203.0]]))
    made.feed(COUNTED.name(train=TRAIN), counted, 0.0)
    return made


def shown(state: LiveStateStore, **asked: Any) -> dict[str, Any]:
    return frame(state, Asked(**asked), Lists(), lambda _: 1, 0.0)


def test_its_topics_are_read_as_it_says() -> None:
    names = {
        AXLES.name(section="s1"): (ARRAY,),
        COUNTED.name(train=TRAIN): (ARRAY,),
        PULSES.name(head="h1"): ("std_msgs/msg/UInt8MultiArray",),
    }
    always, picked, pulses = names

    def held(*wishes: Wish, ticking: bool = True) -> set[str]:
        return set(wanted.wanted(names, wishes, {}, ticking=ticking)) & set(names)

    assert held() == held(ticking=False) == {always}
    assert held(Wish(TRAIN)) == {always, picked}
    assert held(Wish(telegrams=True)) == {always, pulses}
    assert held(Wish(telegrams=True), ticking=False) == {always}


def test_its_sections_and_sensors_are_drawn_with_their_states(state: LiveStateStore) -> None:
    rows = {row["name"]: row for row in shown(state)["line"]["rows"]}
    assert rows["axle sections"] == {
        "name": "axle sections",
        "legend": "section occupied",
        "marks": [{"name": "h1", "track": "main", "at_m": 400.0}],
        "stretches": [{"name": "s1", "track": "main", "start_m": 0.0, "end_m": 400.0}],
        "symbol": "square",
        "on_track": False,
    }
    sensor = {"h1": ["miscounts", True, "bad"]}
    assert shown(state)["states"]["axle sections"] == sensor
    raw = TableWriter(("s1",), AXLES.columns).write(0, np.array([[2.0]]))
    state.feed(AXLES.name(section="s1"), raw, 0.0)
    occupied = sensor | {"s1": ["occupied", True, ""]}
    assert shown(state)["states"]["axle sections"] == occupied


def test_its_card_stands_in_its_group_and_its_cell_in_its_column(state: LiveStateStore) -> None:
    odometer = TableWriter((TRAIN,), ("distance_m",)).write(0, np.array([[5.0]]))
    state.feed(f"/{TRAIN}/odometer", odometer, 0.0)
    message = shown(state, train=TRAIN)
    cards = message["cards"]
    assert [card["title"] for card in cards] == ["Axle counter", "Odometer"]
    assert cards[0]["rows"] == [["axles", "8", ""]]
    assert "axles" in [column["key"] for column in message["line"]["columns"]]
    (train,) = message["trains"]
    assert train["cells"] == {"axles": ["8", "warned", "", None]}
    assert train["intervals"] == [
        {"track": "main", "low_m": 202.0, "high_m": 204.0, "label": "section of the train"}
    ]


def test_its_error_follows_those_of_the_built_in_equipment(state: LiveStateStore) -> None:
    state.look(writers=1)
    message = shown(state)
    assert [trace["label"] for trace in message["line"]["traces"]] == ["localizer", "axle counter"]
    (row,) = message["history"]["rows"]
    assert row[1] == ["main", None, None, 200.0, None, None, None, 3.0, 2.0, 4.0]


def test_it_has_a_tab_of_its_own(state: LiveStateStore) -> None:
    panels = {panel["name"]: panel["label"] for panel in shown(state)["line"]["panels"]}
    assert panels == {"codes": "Track codes", "telegrams": "Telegrams", "axles": "Axles"}
    panel = shown(state, tab="axles", train=TRAIN)["panel"]
    assert (panel["title"], panel["rows"]) == ("Sections", ((("s1", ""), ("2", "axles")),))
    assert shown(LiveStateStore(), tab="axles")["panel"] is None


def test_a_log_of_its_own_holds_no_telegrams_of_others(
    state: LiveStateStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = PanelSpec("axles", "Axles", "There is no axle counter.", log=True)
    monkeypatch.setattr(AxleCounterView, "panel", log)
    state.feed(PULSES.name(head="h1"), b"123", 0.0)
    (line,) = shown(state, tab="axles")["telegrams"]
    assert (line["id"], line["seq"], line["place"]) == (1, 3, "h1")
    assert shown(state, tab="telegrams")["telegrams"] == []


def test_an_announcement_without_what_it_needs_is_passed_over(state: LiveStateStore) -> None:
    before = shown(state)["line"]
    broken = LINE | {"wheel_sensors": [{"name": "h1"}]}
    state.feed(SCENARIO.name(), serialize_message(String(data=json.dumps(broken))), 0.0)
    assert shown(state)["line"] == before
    assert math.isclose(before["tick_s"], 0.25)
