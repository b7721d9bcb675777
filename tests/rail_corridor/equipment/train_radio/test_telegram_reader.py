"""Telegrams in words, whatever the bytes are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rail_corridor.equipment.train_radio.telegram_reader import TelegramReader
from rail_corridor.view.message_log import MOST_LINES, MessageLog
from rail_msgs_py.train_radio.movement_authority import MovementAuthority
from rail_msgs_py.train_radio.safe_frame import (
    FRAME_BYTES,
    VERSION,
    FrameKind,
    Header,
    write_header,
)
from rail_msgs_py.train_radio.telegrams import Telegrams, telegrams
from rail_msgs_py.train_radio.train_channel import CONTROLLER_IDENTITY
from rail_msgs_py.train_radio.train_report import LocationReport


def frame(kind: int, source: int, destination: int, payload: bytes) -> bytes:
    header = Header(VERSION, kind, len(payload), source, destination, 7, 1_000_000, 3, 9)
    return (write_header(header) + payload).ljust(FRAME_BYTES, b"\0")


REPORT = LocationReport(1, 0, 1234.5, 1, 20.0, 3.0, 118.0, True, True)
AUTHORITY = MovementAuthority(2, 0, 1, 987.5, 22.0, 3.0)


@pytest.fixture
def reader() -> TelegramReader:
    return TelegramReader(("first", "second"), ("main",))


def test_a_report_and_an_authority_in_words(reader: TelegramReader) -> None:
    report = frame(FrameKind.LOCATION_REPORT, 1, CONTROLLER_IDENTITY, REPORT.to_bytes())
    authority = frame(FrameKind.MOVEMENT_AUTHORITY, CONTROLLER_IDENTITY, 2, AUTHORITY.to_bytes())
    log = MessageLog()
    log.put(reader.entries("/first/atp/telegrams", telegrams(500_000_000, [(1, report)]).to_cdr()))
    topic = "/wayside/zone_controller/base3/telegrams"
    log.put(reader.entries(topic, telegrams(750_000_000, [(2, authority)]).to_cdr()))
    one, other = log.since(0)
    assert (one["from"], one["to"], one["kind"]) == ("first", "zone controller", "location report")
    assert one["text"] == "front at 1234.5 m on main ± 3.0 m, 72 km/h"
    assert (one["stage"], one["place"], one["t"], one["seq"]) == ("sent by train", "first", 0.5, 7)
    assert (other["to"], other["place"]) == ("second", "base3")
    assert other["text"] == "up to 987.5 m on main, 79 km/h, valid 3.0 s"
    assert log.since(one["id"]) == [other]


def test_unknown_ends_kinds_and_contents_are_said_to_be_so(reader: TelegramReader) -> None:
    shown = reader.describe(frame(9, 77, 1, b"abc"))
    assert (shown.source, shown.destination, shown.kind) == ("number 77", "first", "kind 9")
    assert shown.text == "3 bytes"
    assert reader.describe(b"short").kind == "unreadable"
    assert list(reader.entries("/first/atp/telegrams", Telegrams(0, ()).to_cdr())) == []


@given(st.binary(min_size=FRAME_BYTES, max_size=FRAME_BYTES))
def test_no_frame_is_too_strange_to_be_shown(raw: bytes) -> None:
    shown = TelegramReader().describe(raw).shown()
    assert shown.pop("t") == 0.0
    assert all(isinstance(value, str | int) for value in shown.values())


def test_the_log_is_of_bounded_length(reader: TelegramReader) -> None:
    noise, log = np.random.default_rng(1).bytes(FRAME_BYTES), MessageLog()
    for _ in range(MOST_LINES // 8 + 5):
        log.put(
            reader.entries("/first/cbtc_radio/telegrams", telegrams(0, [(1, noise)] * 8).to_cdr())
        )
    lines = log.since(0)
    assert len(lines) == MOST_LINES
    assert lines[-1]["id"] == 8 * (MOST_LINES // 8 + 5)
