"""What `rail echo` shows of messages: fields, rows, conditions, counts, CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray

from rail_corridor.cli import echo as echo_module
from rail_corridor.cli.echo import Echo, column_lines
from rail_corridor.cli.filters import Filter
from rail_corridor.cli.selection import Selection, field_names_in
from rail_corridor.cli.usage import UsageError
from rail_msgs_py.ranging.range_reading import RangeReading
from rail_msgs_py.table import Table
from rail_msgs_py.topics.world import ODOMETER, STATE
from rail_msgs_py.train_radio.safe_frame import FRAME_BYTES
from rail_msgs_py.train_radio.telegrams import Telegrams
from rail_msgs_py.waveform import Waveform, silence

ONE, MANY, RANGE, WAVE = (
    *("/train_a/odometer", "/world/state"),
    *("/wayside/wrs1/zone1/range", "/wayside/wrs1/zone1/tx"),
)
SECOND = 1_000_000_000


def odometer(time_s: int) -> Any:
    """Return a train that has run for so long at 0.5 m/s for each second."""
    values = np.array([[0.25 * time_s**2, 0.5 * time_s]])
    return Table(time_s * SECOND, ("train_a",), ODOMETER.columns, values).to_msg()


def state(time_s: int) -> Any:
    """Return two trains: the one at 1 m/s for each second, the other at twice that."""
    values = np.zeros((2, len(STATE.columns)))
    values[:, STATE.index["speed_mps"]] = time_s, 2.0 * time_s
    return Table(time_s * SECOND, ("train_a", "train_b"), STATE.columns, values).to_msg()


def shown(topic: str, messages: Any, **chosen: Any) -> list[str]:
    """Return the lines of all messages."""
    if "where" in chosen:
        chosen["where"] = Filter(chosen["where"])
    lines: list[str] = []
    echo = Echo(topic, Selection(**chosen), lines.append)
    for message in messages:
        echo.take(message)
    return "\n".join(lines).splitlines()


def test_fields_of_a_table_as_text() -> None:
    assert shown(ONE, [odometer(2)], fields=("speed_mps",)) == [
        "     2.000 s  train_a: speed_mps 1"
    ]


def test_a_table_of_one_row_as_csv_has_a_header_once() -> None:
    lines = shown(ONE, map(odometer, range(3)), fields=("speed_mps",), format="csv")
    assert lines == ["stamp_s,speed_mps", "0.0,0.0", "1.0,0.5", "2.0,1.0"]


def test_every_row_is_a_line_of_csv() -> None:
    lines = shown(MANY, [state(1), state(2)], fields=("speed_mps",), format="csv")
    assert lines == [
        "stamp_s,row,speed_mps",
        *("1.0,train_a,1.0", "1.0,train_b,2.0", "2.0,train_a,2.0", "2.0,train_b,4.0"),
    ]


def test_fields_of_several_rows_are_columns() -> None:
    fields = ("train_b.speed_mps", "train_a.speed_mps")
    lines = shown(MANY, [state(1)], fields=fields, format="csv")
    assert lines == ["stamp_s,train_b.speed_mps,train_a.speed_mps", "1.0,2.0,1.0"]


def test_one_row_is_chosen() -> None:
    lines = shown(MANY, [state(1)], row="train_b", fields=("speed_mps",), format="csv")
    assert lines == ["stamp_s,speed_mps", "1.0,2.0"]
    assert shown(MANY, [state(1)], row="train_b")[0].startswith("     1.000 s  train_b: path_m 0 ")


def test_rows_that_a_condition_leaves() -> None:
    lines = shown(MANY, map(state, range(3)), where="speed_mps > 1", fields=("row", "speed_mps"))
    assert lines == [
        "     1.000 s  train_b: row train_b  speed_mps 2",
        "     2.000 s  train_a: row train_a  speed_mps 2",
        "     2.000 s  train_b: row train_b  speed_mps 4",
    ]


def test_a_condition_over_two_rows() -> None:
    where = "train_b.speed_mps > train_a.speed_mps and stamp_s >= 2"
    fields = ("train_a.speed_mps",)
    lines = shown(MANY, map(state, range(4)), where=where, fields=fields, format="csv")
    assert lines == ["stamp_s,train_a.speed_mps", "2.0,2.0", "3.0,3.0"]


def test_every_nth_of_those_that_pass_and_no_more_than_asked_for() -> None:
    chosen: dict[str, Any] = {"fields": ("stamp_s",), "format": "csv", "every": 3, "count": 2}
    assert shown(ONE, map(odometer, range(20)), **chosen) == ["stamp_s", "0.0", "3.0"]
    assert shown(ONE, map(odometer, range(20)), where="speed_mps > 2", **chosen) == [
        *("stamp_s", "5.0", "8.0")
    ]


def test_it_is_complete_with_the_last_message_asked_for() -> None:
    echo = Echo(ONE, Selection(count=2), lambda _: None)
    echo.take(odometer(0))
    assert not echo.complete
    echo.take(odometer(1))
    assert echo.complete


def test_json_is_an_object_for_each_message() -> None:
    lines = shown(MANY, [state(1)], fields=("speed_mps",), format="json")
    assert [json.loads(line) for line in lines] == [
        {"stamp_s": 1.0, "rows": {"train_a": {"speed_mps": 1.0}, "train_b": {"speed_mps": 2.0}}}
    ]
    lines = shown(ONE, [odometer(2)], format="json")
    assert [json.loads(line) for line in lines] == [
        {"stamp_s": 2.0, "distance_m": 1.0, "speed_mps": 1.0}
    ]


def test_what_is_not_finite_stays_readable() -> None:
    readings = [
        RangeReading(SECOND, "zone1", value, math.inf, 0.0, 400.0).to_msg()
        for value in (math.inf, math.nan, 2.5)
    ]
    chosen: dict[str, Any] = {"fields": ("range_m", "usable")}
    lines = shown(RANGE, readings, format="json", **chosen)
    assert [json.loads(line)["range_m"] for line in lines] == ["inf", "nan", 2.5]
    lines = shown(RANGE, readings, format="csv", **chosen)
    assert lines[1:] == ["1.0,inf,false", "1.0,nan,false", "1.0,2.5,true"]
    assert shown(RANGE, readings, where="range_m < inf") == ["     1.000 s  zone1: 2.500 m ± inf m"]


def test_a_view_without_chosen_fields_shows_whatever_is_one_value() -> None:
    block = Waveform(SECOND, 4e6, 2.4e9, 2, np.full((1, 8), 1e-3 + 0j))
    blocks = [silence(0, 4e6, 2.4e9, 2).to_msg(), block.to_msg()]
    lines = shown(WAVE, blocks, format="csv", where="channel == 2 and not silent")
    (row,) = csv.DictReader(io.StringIO("\n".join(lines)))
    assert list(row) == [
        *("stamp_s", "sample_rate_hz", "carrier_hz", "channel", "silent", "power_dbm")
    ]
    assert row["channel"] == "2" and row["silent"] == "false"


def test_paths_in_messages_without_a_view() -> None:
    clock = Clock()
    clock.clock.sec = 7
    assert shown("/clock", [clock], fields=("clock.sec",), format="csv") == [
        "stamp_s,clock.sec",
        "7.0,7",
    ]
    array = DiagnosticArray(status=[DiagnosticStatus(name="a, b"), DiagnosticStatus(name="c")])
    fields = ("status[0].name", "status.1.name")
    lines = shown("/diagnostics", [array], fields=fields, format="csv")
    assert lines == ["stamp_s,status[0].name,status.1.name", '0.0,"a, b",c']


def test_a_message_without_a_view_is_an_object_as_a_whole() -> None:
    status = DiagnosticStatus(level=b"\x02", name="a")
    (line,) = shown("/diagnostics", [DiagnosticArray(status=[status])], format="json")
    found = json.loads(line)
    assert found["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    assert found["status"][0]["level"] == 2 and found["status"][0]["name"] == "a"


def test_a_list_is_one_cell() -> None:
    sent = Telegrams(SECOND, ((3, bytes(FRAME_BYTES)),))
    lines = shown("/train_a/atp/telegrams", [sent.to_msg()], format="csv")
    (row,) = csv.DictReader(io.StringIO("\n".join(lines)))
    assert json.loads(row["frames"]) == [[3, "00" * FRAME_BYTES]]


def test_raw_fields_are_those_of_the_message() -> None:
    lines = shown(
        ONE, [odometer(2)], raw=True, fields=("data", "layout.data_offset"), format="json"
    )
    assert json.loads(lines[0]) == {
        **{"stamp_s": 2.0, "data": [2.0, 1.0, 1.0], "layout.data_offset": 1}
    }


@pytest.mark.parametrize(
    ("topic", "chosen", "line"),
    [
        (ONE, {"fields": ("speed",)}, "speed: is no such field; there are distance_m, speed_mps"),
        (ONE, {"where": "speed > 3"}, "speed: is no such field; there are distance_m, speed_mps"),
        (RANGE, {"fields": ("range",)}, "range: is no such field; there are stamp_ns, zone, range"),
        (RANGE, {"fields": ("from_msg",)}, "from_msg: is no such field"),
        (RANGE, {"row": "x"}, "--row: x: /wayside/wrs1/zone1/range has no rows"),
    ],
)
def test_a_field_that_is_none_is_refused_before_any_message(
    topic: str, chosen: dict[str, Any], line: str
) -> None:
    with pytest.raises(UsageError, match=f"^{line}"):
        shown(topic, [], **chosen)


@pytest.mark.parametrize(
    ("chosen", "line"),
    [
        ({"row": "nobody"}, "--row: nobody: is no such row; there are train_a, train_b"),
        (
            {"fields": ("nobody.speed_mps",)},
            r"nobody\.speed_mps: is no such field; there are train_a\.speed_mps",
        ),
        ({"raw": True, "fields": ("layout.dims",)}, r"layout\.dims: is no such field"),
        ({"raw": True, "fields": ("data[999]",)}, r"data\[999\]: has no item 999"),
        ({"raw": True, "fields": ("__class__",)}, "__class__: is no such field"),
        ({"raw": True, "where": "layout.dim"}, None),
    ],
)
def test_one_that_a_message_lacks_is_refused_with_it(
    chosen: dict[str, Any], line: str | None
) -> None:
    if line is None:
        assert shown(MANY, [state(1)], **chosen)
        return
    with pytest.raises(UsageError, match=f"^{line}"):
        shown(MANY, [state(1)], **chosen)


def test_a_message_that_is_not_what_its_topic_carries_spoils_no_table() -> None:
    wrong = Float64MultiArray(data=[1.0])
    lines = shown(ONE, [wrong, odometer(2)], fields=("speed_mps",), format="csv")
    assert lines == ["stamp_s,speed_mps", "2.0,1.0"]


def test_names_in_the_text_of_an_option() -> None:
    assert field_names_in("a, b.c") == ("a", "b.c")
    with pytest.raises(UsageError, match="--field"):
        field_names_in("a,,b")


def test_columns_say_what_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    class Described:
        columns = ("distance_m", "speed_mps")
        column_texts = ("way since the start", "by the wheels")

    monkeypatch.setattr(echo_module, "kind_of", lambda _: Described)
    assert column_lines(ONE) == ["# distance_m  way since the start", "# speed_mps   by the wheels"]
    assert column_lines(ONE, ("train_a.speed_mps",)) == ["# speed_mps  by the wheels"]


def test_where_nothing_is_said_of_columns_there_is_no_header(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(echo_module, "kind_of", lambda _: replace(ODOMETER, table=()))
    assert column_lines("/else") == column_lines(ONE) == []
