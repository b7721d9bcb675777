"""The pace of trains on the localizer: what the study counts, and one of its cells."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rail_corridor.run_data import RunData
from rail_corridor.studies import localizer_pace
from rail_corridor.studies.localizer_pace import (
    PLACES_M,
    PaceParameters,
    arrivals_s,
    braked_while_moving,
    compare_pace,
)
from rail_corridor.studies.registry import CALCULATIONS, FOLDER, GENERATORS
from rail_corridor.study.study_file import load_study
from rail_msgs_py.topics.world import COMMAND, STATE

TICK_S = 0.5
TICKS = 200


def run_of(speed_mps: float, second_mps: float, **braked: range) -> RunData:
    """Return a run of two trains at their speeds, with the brakes demanded in some ticks."""
    state = np.zeros((TICKS, 2, len(STATE.columns)))
    command = np.zeros((TICKS, 2, len(COMMAND.columns)))
    time_s = TICK_S * (np.arange(TICKS) + 1.0)
    for index, mps in enumerate((speed_mps, second_mps)):
        state[:, index, STATE.index["chainage_m"]] = PLACES_M[index][0] + mps * time_s
        state[:, index, STATE.index["speed_mps"]] = mps
    for name, ticks in braked.items():
        command[ticks, :, COMMAND.index[name]] = 1.0
    tables = {STATE.pattern: state, COMMAND.pattern: command}

    class Run:
        ticks = TICKS

        def __getitem__(self, topic: Any) -> Any:
            return SimpleNamespace(upto=lambda ticks: tables[topic.pattern][:ticks])

    return cast(RunData, Run())


def test_arrivals_are_those_of_the_way_and_the_speed() -> None:
    # 540 m each: at 20 m/s 27 s; at 3 m/s it would be 180 s, later than the end of the run.
    first_s, second_s = arrivals_s(run_of(20.0, 3.0), TICK_S)
    assert first_s == pytest.approx(27.0)
    assert second_s == np.inf


def test_braking_of_either_brake_counts_where_the_train_runs() -> None:
    run = run_of(20.0, 0.0, service_brake=range(3), emergency_brake=range(2, 7))
    assert np.count_nonzero(braked_while_moving(run), axis=0).tolist() == [7, 0]


def test_longer_is_by_the_worse_of_the_two(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = {
        True: (np.array([50.0, 44.0]), np.array([[True, False], [True, True]])),
        False: (np.array([50.0, 40.0]), np.zeros((2, 2), dtype=bool)),
    }
    monkeypatch.setattr(localizer_pace, "_run", lambda _, seed, localizer: runs[localizer])
    counted = compare_pace(PaceParameters(), 1)
    assert counted["longer_pct"] == pytest.approx(10.0)
    assert (counted["arrived"], counted["braked_ticks"]) == (2.0, 3.0)


def test_who_never_arrives_is_late(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = {True: np.array([50.0, np.inf]), False: np.array([50.0, 40.0])}
    none = np.zeros((2, 2), dtype=bool)
    monkeypatch.setattr(localizer_pace, "_run", lambda _, seed, localizer: (runs[localizer], none))
    counted = compare_pace(PaceParameters(), 1)
    assert counted["longer_pct"] is not None and counted["longer_pct"] > 1e6
    assert counted["arrived"] == 1.0 and counted["time_s"] is None


def test_the_study_fails_where_trains_are_slower_or_braked() -> None:
    study, _ = load_study("localizer_pace", FOLDER, GENERATORS, CALCULATIONS)
    assert study.figures["longer_pct"].at_most == 5.0
    assert study.figures["braked_ticks"].must_be == 0.0
    assert study.figures["arrived"].must_be == 2.0


@pytest.mark.parametrize(("limit_kmh", "tick_s"), [(25.0, 0.5)])
def test_trains_on_the_localizer_are_as_fast_and_never_braked(
    limit_kmh: float, tick_s: float
) -> None:
    counted = compare_pace(PaceParameters(limit_kmh=limit_kmh, tick_s=tick_s), 1)
    assert counted["arrived"] == 2.0
    assert counted["longer_pct"] is not None and counted["longer_pct"] <= 5.0
    assert counted["braked_ticks"] == 0.0
