"""A train's positions by Doppler shifts, block after block, from samples."""

from __future__ import annotations

import numpy as np
import pytest

from rail_onboard.doppler.positioner import DopplerPositioner, Tracking
from rail_signals.doppler.receiver import ToneReceiver
from rail_signals.doppler.signal import block_times_s, received_tones
from rail_signals.doppler.solver import DopplerSolver, NoFixReason
from rail_signals.doppler.surveyed_line import SurveyedLine
from rail_signals.doppler.tone_plan import TonePlan

PLAN = TonePlan()
TICK_S, SPEED_MPS, OFFSET_HZ = 0.1, 40.0, -850.0
CHAINAGE_M = np.arange(0.0, 6001.0, 5.0)
LINE = SurveyedLine(CHAINAGE_M, CHAINAGE_M, 0 * CHAINAGE_M, 0 * CHAINAGE_M, 0 * CHAINAGE_M)
FEET_M = np.arange(0.0, 6001.0, 500.0)
STATIONS = np.column_stack([FEET_M, np.where(np.arange(13) % 2, 25.0, -25.0), np.full(13, 6.0)])
SLOTS = np.arange(13) % PLAN.slots


def block_at(s: float, rng: np.random.Generator, v: float = SPEED_MPS) -> np.ndarray:
    near = np.flatnonzero(np.abs(FEET_M - s) < 1250.0)
    distance = LINE.distances(STATIONS[near], s + v * block_times_s(PLAN)).T
    block = received_tones(
        PLAN, SLOTS[near].tolist(), distance, 30.0 / distance, offset_hz=OFFSET_HZ
    )
    noise = rng.normal(scale=0.02, size=(PLAN.samples, 2)).view(np.complex128)[:, 0]
    return np.asarray(block + noise)


def positioner(start_m: float) -> DopplerPositioner:
    solver = DopplerSolver(PLAN, LINE, STATIONS, SLOTS)
    return DopplerPositioner(ToneReceiver(PLAN), solver, Tracking(60.0), start_m, 1)


def test_a_train_is_followed_past_stations_that_share_a_tone() -> None:
    rng, mine = np.random.default_rng(4), positioner(300.0)
    errors, known = [], 0
    ticks = range(0, 1300, 4)
    for tick in ticks:
        s = 300.0 + SPEED_MPS * TICK_S * tick
        answer = mine.locate(block_at(s, rng), 4 * TICK_S)
        if answer.reason is NoFixReason.NONE:
            assert answer.fix is not None
            known += 1
            errors.append((answer.fix.chainage_m - s) / answer.fix.sigma_m)
            assert answer.fix.offset_hz == pytest.approx(OFFSET_HZ, abs=20.0)
    assert known > 0.8 * len(ticks)
    # Variances hold what stations and oscillators may do, and here they do nothing.
    assert np.sqrt(np.mean(np.square(errors))) < 1.1
    assert np.abs(errors).max() < 5.0


def test_silence_and_rubbish_are_no_position_and_the_train_is_found_again() -> None:
    rng, mine = np.random.default_rng(4), positioner(1390.0)
    assert mine.locate(None, 0.0).reason is NoFixReason.TOO_FEW_STATIONS
    assert mine.locate(np.full(PLAN.samples, np.nan, dtype=complex), 0.1).fix is None
    noise = rng.normal(size=(PLAN.samples, 2)).view(np.complex128)[:, 0]
    assert mine.locate(noise, 0.1).reason is NoFixReason.TOO_FEW_STATIONS
    found = mine.locate(block_at(1400.0, rng), 0.1)
    assert found.fix is not None and found.fix.chainage_m == pytest.approx(1400.0, abs=1.0)


def test_a_train_that_stands_has_no_place() -> None:
    mine = positioner(1200.0)
    assert mine.locate(block_at(1200.0, np.random.default_rng(1), 0.0), 0.0).fix is None


# Switched on anew ------------------------------------------------------------------------

#: A straight line on which the ten tones come four times: places 5 km apart look the same.
LONG_M = np.arange(0.0, 18001.0, 5.0)
LONG_LINE = SurveyedLine(LONG_M, LONG_M, 0 * LONG_M, 0 * LONG_M, 0 * LONG_M)
LONG_FEET_M = np.arange(0.0, 18001.0, 500.0)
LONG_STATIONS = np.column_stack(
    [LONG_FEET_M, np.where(np.arange(37) % 2, 25.0, -25.0), np.full(37, 6.0)]
)
CYCLE_M = 500.0 * PLAN.slots


def long_block(s: float, rng: np.random.Generator, v: float = SPEED_MPS) -> np.ndarray:
    near = np.flatnonzero(np.abs(LONG_FEET_M - s) < 1250.0)
    distance = LONG_LINE.distances(LONG_STATIONS[near], s + v * block_times_s(PLAN)).T
    slots = (near % PLAN.slots).tolist()
    block = received_tones(PLAN, slots, distance, 30.0 / distance, offset_hz=OFFSET_HZ)
    noise = rng.normal(scale=0.02, size=(PLAN.samples, 2)).view(np.complex128)[:, 0]
    return np.asarray(block + noise)


def on_long_line(start_m: float | None) -> DopplerPositioner:
    slots = np.arange(37) % PLAN.slots
    solver = DopplerSolver(PLAN, LONG_LINE, LONG_STATIONS, slots)
    assert solver.cycle_m == pytest.approx(CYCLE_M, abs=solver.grid_step_m)
    return DopplerPositioner(ToneReceiver(PLAN), solver, Tracking(60.0), start_m, 1)


def test_one_who_does_not_know_where_it_was_is_never_a_cycle_off() -> None:
    rng, mine = np.random.default_rng(7), on_long_line(None)
    for tick in range(20):
        s = 7950.0 + SPEED_MPS * TICK_S * tick
        assert mine.locate(long_block(s, rng), TICK_S).fix is None
    assert not mine.sure
    # Placed a cycle off, on the other hand, it is a cycle off: nothing in the shifts is wrong.
    wrong = on_long_line(7950.0 - CYCLE_M).locate(long_block(7950.0, rng), TICK_S).fix
    assert wrong is not None
    assert wrong.chainage_m == pytest.approx(7950.0 - CYCLE_M, abs=5.0)


def test_it_is_told_where_to_look_by_whom_knows_it_well_enough() -> None:
    rng, mine = np.random.default_rng(7), on_long_line(None)
    mine.tell(4000.0, 12000.0)
    assert mine.locate(long_block(7950.0, rng), TICK_S).reason is NoFixReason.AMBIGUOUS
    mine.tell(7900.0, 8000.0)
    found = mine.locate(long_block(7954.0, rng), TICK_S).fix
    assert found is not None and found.chainage_m == pytest.approx(7954.0, abs=5.0)
    # Once it knows, what others say is of no account.
    mine.tell(7900.0 - CYCLE_M, 8000.0 - CYCLE_M)
    found = mine.locate(long_block(7958.0, rng), TICK_S).fix
    assert found is not None and found.chainage_m == pytest.approx(7958.0, abs=5.0)


def test_where_no_two_stations_in_reach_share_a_tone_three_blocks_find_it() -> None:
    rng = np.random.default_rng(7)
    solver = DopplerSolver(PLAN, LINE, STATIONS, SLOTS)
    mine = DopplerPositioner(ToneReceiver(PLAN), solver, Tracking(60.0), None, 1)
    reasons = []
    for tick in range(4):
        s = 2950.0 + SPEED_MPS * TICK_S * tick
        answer = mine.locate(block_at(s, rng), TICK_S)
        reasons.append(answer.reason)
    ambiguous, none = NoFixReason.AMBIGUOUS, NoFixReason.NONE
    assert reasons == [ambiguous, ambiguous, none, none]
    assert answer.fix is not None and answer.fix.chainage_m == pytest.approx(s, abs=5.0)


def test_after_a_long_silence_it_is_as_if_switched_on() -> None:
    rng, mine = np.random.default_rng(7), on_long_line(7950.0)
    assert mine.locate(long_block(7950.0, rng), TICK_S).fix is not None
    mine.locate(None, 5.0)
    assert mine.sure
    for _ in range(8):
        mine.locate(None, 5.0)
    assert not mine.sure
    assert mine.locate(long_block(9500.0, rng), TICK_S).reason is NoFixReason.AMBIGUOUS


def test_a_train_that_stands_stays_where_it_is() -> None:
    rng, mine = np.random.default_rng(7), on_long_line(7950.0)
    for _ in range(100):
        answer = mine.locate(long_block(7950.0, rng, 0.0), 1.0)
        assert answer.reason is NoFixReason.STANDSTILL
    assert mine.sure
