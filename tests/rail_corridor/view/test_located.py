"""What a viewer makes of the answer of a localizer."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from rail_corridor.equipment.localizer.live_estimate import STATUS, error_of, estimate_of
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.announcement import announcement
from rail_corridor.view.frame import Asked, Lists, frame
from rail_corridor.view.history import history_row
from rail_corridor.view.live_state import LiveStateStore
from rail_corridor.view.sensors import cards
from rail_msgs_py.table import TableWriter
from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.localizer import LOCALIZER_STATE, RELAYED_RANGE
from rail_msgs_py.topics.train_radio import REPORTS
from rail_msgs_py.topics.world import SCENARIO, STATE
from rail_signals.localizer.protection_level import ProtectionReason, Status
from rail_signals.localizer.settings import Sensor

TRAIN = "first"
TICK_NS = 250_000_000
TOPIC = LOCALIZER_STATE.name(train=TRAIN)
PLACE = {"front_m": 1000.5, "low_m": 997.5, "high_m": 1005.5, "speed_mps": 20.0, "sigma_m": 0.4}


@pytest.fixture(scope="module")
def announced() -> bytes:
    text = announcement(load_scenario("located_block"))
    raw: bytes = serialize_message(String(data=text))
    return raw


@pytest.fixture
def state(announced: bytes) -> LiveStateStore:
    made = LiveStateStore()
    made.feed(SCENARIO.name(), announced, 0.0)
    for tick, chainage_m in enumerate((1000.0, 1005.0)):
        state = np.zeros((3, len(STATE.columns)))
        state[0, [5, 8, 9]] = (20.0, chainage_m, 1.0)
        writer = TableWriter((TRAIN, "second", "third"), STATE.columns)
        made.feed("/world/state", writer.write(tick * TICK_NS, state), 0.25 * tick)
    return made


def say(state: LiveStateStore, tick: int = 0, **values: float) -> None:
    """Feed an answer; without a place if none is given."""
    nothing = {"front_m": math.nan, "low_m": -math.inf, "high_m": math.inf, "sigma_m": math.inf}
    row = [float({**nothing, **values}.get(column, 0.0)) for column in LOCALIZER_STATE.columns]
    writer = TableWriter((TRAIN,), LOCALIZER_STATE.columns)
    state.feed(TOPIC, writer.write(tick * TICK_NS, np.array([row])), 0.3)


def shown(state: LiveStateStore) -> Any:
    message = frame(state, Asked(train=TRAIN), Lists(), lambda _: 1, 0.3)
    (card,) = [card for card in message["cards"] if card["topic"] == TOPIC]
    return message["trains"][0]["located"], card


def test_the_interval_is_held_against_the_truth_of_its_own_tick(state: LiveStateStore) -> None:
    assert estimate_of(state, TRAIN) is None
    assert "located" not in frame(state, Asked(), Lists(), lambda _: 1, 0.3)["trains"][0]
    say(state, tick=0, status=Status.PROTECTED, **PLACE)  # the truth of tick 1 is there too
    assert error_of(state, TRAIN) == pytest.approx((0.5, -2.5, 5.5))
    assert history_row(state, TRAIN) == ["main", None, None, 1005.0, 0.5, -2.5, 5.5]
    train, card = shown(state)
    assert (train["status"], train["protection_m"], train["track"]) == ("protected", 5.0, "main")
    assert (train["error_m"], train["holds"]) == (0.5, True)
    assert ["interval", "997.5 to 1005.5", "m"] in card["rows"]
    # It reaches further ahead than behind, from the position that it says.
    gauge = {"off_m": 0.5, "half_m": 5.0, "what": "protection level", "low_m": -3.0, "high_m": 5.0}
    assert card["gauge"] == gauge


@pytest.mark.parametrize(("low_m", "high_m"), [(1000.1, 1005.0), (990.0, 999.9)])
def test_an_interval_that_does_not_hold_the_train_is_told(
    state: LiveStateStore, low_m: float, high_m: float
) -> None:
    say(state, **{**PLACE, "low_m": low_m, "high_m": high_m}, status=Status.PROTECTED)
    assert shown(state)[0]["holds"] is False


def test_a_train_that_is_not_located_has_a_reason_and_no_place(state: LiveStateStore) -> None:
    excluded = (1 << Sensor.DOPPLER) + (1 << Sensor.ODOMETER)
    say(state, status=Status.UNAVAILABLE, reason=ProtectionReason.TOO_WIDE, excluded=excluded)
    train, card = shown(state)
    assert (train["status"], train["reason"]) == ("unavailable", "too wide")
    assert train["left_out"] == ("doppler", "odometer")
    assert "at_m" not in train
    assert card["rows"] == [
        ["status", "not known (too wide)", ""],
        ["left out as faulty", "doppler, odometer", ""],
    ]
    assert card["gauge"] is None
    assert history_row(state, TRAIN) == ["main", None, None, 1005.0]


def test_a_state_of_another_version_is_a_table_like_any_other(state: LiveStateStore) -> None:
    writer = TableWriter((TRAIN,), ("status", "front_m"))
    state.feed(TOPIC, writer.write(0, np.array([[2.0, 1000.0]])), 0.3)
    assert estimate_of(state, TRAIN) is None
    (card,) = [c for c in cards(state, TRAIN, lambda _: 1) if c["topic"] == TOPIC]
    assert ["front", "1000.00", "m"] in card["rows"]


def card_of(
    state: LiveStateStore, topic: str, columns: tuple[str, ...], *rows: dict[str, float]
) -> Any:
    """Feed a table at tick 1 and return the card of it."""
    values = np.array([[row.get(column, math.nan) for column in columns] for row in rows])
    names = tuple(str(number) for number in range(len(rows)))
    message = TableWriter(names, columns).write(TICK_NS, values.reshape(len(rows), len(columns)))
    state.feed(topic, message, 0.3)
    (card,) = [c for c in cards(state, TRAIN, lambda _: 1) if c["topic"] == topic]
    return card


def test_a_position_by_doppler_shifts_in_words(state: LiveStateStore) -> None:
    topic, columns = DOPPLER_FIX.name(train=TRAIN), DOPPLER_FIX.columns
    fix = {"reason": 0.0, "chainage_m": 1006.0, "chainage_m2": 0.25, "speed_mps": 20.0}
    fix |= {"speed_m2ps2": 0.01, "tones": 4.0, "offset_hz": -435.0}
    card = card_of(state, topic, columns, fix)
    assert card["rows"][0] == ["position", "1006.00 ± 1.00", "m (2σ)"]
    assert card["gauge"] == {"off_m": 1.0, "half_m": 1.0, "what": "2σ"}
    card = card_of(state, topic, columns, {"reason": 2.0, "tones": 3.0})
    assert card["rows"] == [["position", "none: standstill", ""], ["tones found", "3", ""]]
    assert card["gauge"] is None


def test_a_position_that_is_told_later_is_held_against_the_truth_of_its_time(
    state: LiveStateStore,
) -> None:
    topic = RELAYED_RANGE.name(train=TRAIN)
    told = {"time_s": 0.0, "position_m": 1000.2, "half_m": 0.8}
    card = card_of(state, topic, RELAYED_RANGE.columns, told)
    assert card["gauge"] == {"off_m": 0.2, "half_m": 0.8, "what": "bound"}
    assert ["position", "1000.20 ± 0.80", "m"] in card["rows"]
    nothing = dict.fromkeys(RELAYED_RANGE.columns, math.nan)
    assert card_of(state, topic, RELAYED_RANGE.columns, nothing)["rows"][0][1] == "none"


def test_a_location_report_in_words(state: LiveStateStore) -> None:
    topic = REPORTS.name(train=TRAIN)
    report = dict.fromkeys(REPORTS.columns, 0.0) | {"offset_m": 999.0, "uncertainty_m": 3.5}
    report |= {"position_valid": 1.0, "length_m": 118.0, "speed_mps": 19.0}
    rows = card_of(state, topic, REPORTS.columns, report)["rows"]
    assert rows[0] == ["front", "999.00 ± 3.50", "m on main"]
    assert ["integrity", "not confirmed", ""] in rows
    report |= {"position_valid": 0.0}
    assert card_of(state, topic, REPORTS.columns, report)["rows"][0][1] == "not known"
    assert card_of(state, topic, REPORTS.columns)["rows"][0][1] == "none in this tick"


def test_words_follow_the_counts_of_the_localizer() -> None:
    assert tuple(status.name.lower() for status in Status) == STATUS
