"""Track codes and supervision: what is put into a recording comes out of it."""

from __future__ import annotations

import numpy as np
import pytest

from rail_corridor.equipment.track_code.placement import circuits_of
from rail_corridor.equipment.track_code.report import code_metrics
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import run_data_of
from rail_corridor.run_data import RunData
from rail_msgs_py.topics.track_code import CODE_RECEIVED, CODE_SENT
from rail_msgs_py.topics.world import COMMAND, STATE

SCENARIO = load_scenario("follow_codes")
TICK_S = SCENARIO.tick_s
DELAY = 8  # ticks from the antenna to a valid message


def recording(
    speed_mps: float = 20.0,
    ticks: int = 200,
    wrong_at: int | None = None,
    ahead_m: float = 900.0,
    permitted_mps: float = 25.0,
) -> RunData:
    """Return a run of two trains at one speed, the first ``ahead_m`` before the second."""
    circuits = circuits_of(SCENARIO)
    made = run_data_of(SCENARIO)
    words = np.arange(len(circuits)) + 100.0
    ends_m = np.array([circuit.end_m for circuit in circuits_of(SCENARIO)])
    history: list[tuple[float, float]] = []
    for tick in range(ticks):
        chainage_m = np.array([ahead_m, 0.0]) + 1.0 + speed_mps * TICK_S * tick
        state = np.zeros((2, len(STATE.columns)))
        state[:, STATE.index["chainage_m"]] = state[:, STATE.index["path_m"]] = chainage_m
        state[:, STATE.index["speed_mps"]] = speed_mps
        state[:, STATE.index["on_line"]] = 1.0
        made[STATE].put(tick, slice(None), state)
        sent = np.zeros((len(circuits), len(CODE_SENT.columns)))
        sent[:, 0] = words
        made[CODE_SENT].put(tick, slice(None), sent)
        here = words[np.searchsorted(ends_m, chainage_m, side="right")]
        history.append((float(here[0]), float(here[1])))
        received = np.zeros((2, len(CODE_RECEIVED.columns)))
        if tick >= DELAY:
            received[:, CODE_RECEIVED.columns.index("valid")] = 1.0
            received[:, CODE_RECEIVED.columns.index("word")] = history[tick - DELAY]
        if tick == wrong_at:
            received[1, CODE_RECEIVED.columns.index("word")] = 7.0
        made[CODE_RECEIVED].put(tick, slice(None), received)
        command = np.zeros((2, len(COMMAND.columns)))
        command[:, 0] = permitted_mps
        made[COMMAND].put(tick, slice(None), command)
    return made


def test_codes_are_counted_and_timed() -> None:
    values = code_metrics(SCENARIO, recording(), 1)["track_code"]
    # 200 ticks of 5 m from the first of circuits of 500 m: two words.
    assert (values["sent"], values["decoded"], values["wrong"]) == (2, 2, 0)
    assert values["latency_s"] == pytest.approx(DELAY * TICK_S)
    assert values["latency_p95_s"] == pytest.approx(DELAY * TICK_S)
    assert values["availability"] == pytest.approx((200 - DELAY) / 200)


def test_a_word_that_was_never_there_is_wrong() -> None:
    values = code_metrics(SCENARIO, recording(wrong_at=50), 1)["track_code"]
    assert values["wrong"] == 1


def test_supervision_that_does_nothing_with_a_train_that_keeps_its_distance() -> None:
    length_m = SCENARIO.trains[0].vehicle.length_m
    values = code_metrics(SCENARIO, recording(), 1)["atp"]
    assert values["margin_min_m"] == pytest.approx(900.0 - length_m)
    assert values["entered_occupied"] == values["interventions"] == 0
    assert values["overspeed_s"] == values["above_permitted_s"] == 0.0
    assert code_metrics(SCENARIO, recording(), 0)["atp"]["margin_min_m"] is None


def test_what_must_not_happen_is_seen() -> None:
    # Ahead by 200 m only: the same circuit is entered while the train ahead is still in it.
    close = code_metrics(SCENARIO, recording(ahead_m=200.0), 1)["atp"]
    assert close["entered_occupied"] >= 1
    # 30 m/s where 100 km/h are allowed, and 25 m/s permitted, for all but the first instant.
    fast = code_metrics(SCENARIO, recording(speed_mps=30.0, ticks=100), 1)["atp"]
    assert fast["overspeed_s"] == pytest.approx(100 * TICK_S)
    assert fast["above_permitted_s"] == pytest.approx(100 * TICK_S)


def test_interventions_are_counted_once_each() -> None:
    made = recording()
    for tick in (*range(40, 60), *range(80, 90)):
        made[COMMAND].put(tick, 1, np.array([0.0, 1.0, 1.0, float(tick >= 80), 0.0, 0.0]))
    values = code_metrics(SCENARIO, made, 1)["atp"]
    assert (values["interventions"], values["emergency_brakes"]) == (2, 1)
