"""From a recording to figures: the errors and handovers put in are those that come out."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from rail_corridor.equipment.ranging.layout import layout_of
from rail_corridor.equipment.ranging.report import HANDOVER_DEPTH_M, train_metrics
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import run_data_of
from rail_corridor.run_data import RunData
from rail_msgs_py.topics.ranging import LINKS, POSITION, VRS_CHANNEL
from rail_msgs_py.topics.world import STATE
from rail_signals.arrays import FloatArray

SCENARIO = load_scenario("plain_line")
LAYOUT = layout_of(SCENARIO)
SPEED_MPS = 20.0
SNR = 1e3


def run(
    path_m: FloatArray,
    channel_at: Callable[[float], int],
    error_m: FloatArray | float = 0.0,
    known: FloatArray | None = None,
) -> RunData:
    """Return the recording of one train along the straight line, 0.1 s apart."""
    count = len(path_m)
    made = run_data_of(SCENARIO)
    errors_m = np.broadcast_to(error_m, count)
    here = STATE.index
    for tick, way_m in enumerate(path_m):
        state = np.zeros((1, len(STATE.columns)))
        state[0, [here["path_m"], here["x_m"], here["chainage_m"]]] = way_m
        state[0, here["speed_mps"]] = SPEED_MPS
        state[0, here["on_line"]] = 1.0
        made[STATE].put(tick, slice(None), state)
        channel = float(channel_at(float(way_m)))
        links = {"snr_down": SNR, "snr_up": SNR, "downlink_channel": channel}
        values = np.array([[links.get(name, channel + 1.0) for name in LINKS.columns]])
        made[LINKS].put(tick, slice(None), values)
        made[VRS_CHANNEL].put(tick, 0, np.array([channel, channel + 1.0, -50.0, -80.0]))
        variance_m2 = 0.04 if known is None or known[tick] else math.inf
        made[POSITION].put(tick, 0, np.array([0.0, way_m + errors_m[tick], variance_m2, SPEED_MPS]))
    return made


def along(start_m: float, end_m: float) -> FloatArray:
    step_m = math.copysign(SPEED_MPS * 0.1, end_m - start_m)
    return np.arange(start_m, end_m, step_m)


def right_channel(way_m: float) -> int:
    return LAYOUT.zone_at("main", min(max(way_m, 0.0), 1199.0)).downlink_channel


# Ranging ----------------------------------------------------------------------------------


def test_errors_put_in_come_out() -> None:
    path_m = along(20.0, 1100.0)
    errors_m = 0.2 * np.random.default_rng(1).standard_normal(len(path_m))
    values = train_metrics(SCENARIO, run(path_m, right_channel, errors_m), 0)
    ranging = values["phase_ranging"]
    assert values["distance_m"] == pytest.approx(path_m[-1] - path_m[0])
    assert ranging["availability"] == 1.0
    assert ranging["rmse_m"] == pytest.approx(math.sqrt(np.mean(errors_m**2)))
    assert ranging["p95_m"] == pytest.approx(np.quantile(np.abs(errors_m), 0.95))
    assert ranging["max_m"] == pytest.approx(np.max(np.abs(errors_m)))
    assert ranging["normalised_error"] == pytest.approx(ranging["rmse_m"] / 0.2)
    assert ranging["wrong_track_ticks"] == ranging["misleading_ticks"] == 0


def test_what_is_not_known_counts_against_availability_only() -> None:
    path_m = along(20.0, 180.0)
    known = np.arange(len(path_m)) % 4 != 0
    errors_m = np.where(known, 0.1, 500.0)
    ranging = train_metrics(SCENARIO, run(path_m, right_channel, errors_m, known), 0)[
        "phase_ranging"
    ]
    assert ranging["availability"] == pytest.approx(np.mean(known))
    assert ranging["max_m"] == pytest.approx(0.1)
    assert ranging["misleading_ticks"] == 0


def test_a_known_position_far_from_the_truth_is_misleading() -> None:
    path_m = along(20.0, 180.0)
    errors_m = np.zeros(len(path_m))
    errors_m[10:13] = 60.0
    ranging = train_metrics(SCENARIO, run(path_m, right_channel, errors_m), 0)["phase_ranging"]
    assert ranging["misleading_ticks"] == 3


def test_the_bound_is_that_of_the_link_over_the_slope_of_the_range() -> None:
    path_m = along(100.0, 180.0)
    ranging = train_metrics(SCENARIO, run(path_m, right_channel), 0)["phase_ranging"]
    # 1 / (gamma N beta^2) for each way, 63.6 m per radian, and d / s beside a mast 5.8 m away.
    flat_m2 = 2.0 / (SNR * 960) * (299_792_458.0 / (4 * math.pi * 375e3)) ** 2
    slope2 = path_m**2 / (path_m**2 + 3.0**2 + 5.0**2)
    assert ranging["bound_m"] == pytest.approx(math.sqrt(np.mean(flat_m2 / slope2)), rel=1e-6)


def test_a_run_of_which_nothing_is_known_has_no_figures() -> None:
    path_m = along(20.0, 60.0)
    nothing = np.zeros(len(path_m))
    ranging = train_metrics(SCENARIO, run(path_m, right_channel, 0.0, nothing), 0)["phase_ranging"]
    assert ranging["availability"] == 0.0
    assert ranging["rmse_m"] is ranging["p95_m"] is ranging["max_m"] is None


# Handovers --------------------------------------------------------------------------------


@pytest.mark.parametrize("ends_m", [(20.0, 1150.0), (1150.0, 20.0)])
def test_every_station_passed_is_a_handover(ends_m: tuple[float, float]) -> None:
    values = train_metrics(SCENARIO, run(along(*ends_m), right_channel), 0)["handovers"]
    assert (values["expected"], values["made"]) == (5, 5)
    assert (values["missed"], values["wrong"]) == (0, 0)
    assert values["furthest_m"] <= SPEED_MPS * 0.1


def test_a_little_late_is_made_and_too_late_is_missed() -> None:
    path_m = along(20.0, 380.0)
    for late_m, missed in ((HANDOVER_DEPTH_M - 3.0, 0), (HANDOVER_DEPTH_M + 10.0, 1)):
        values = train_metrics(
            SCENARIO, run(path_m, lambda way_m, late=late_m: right_channel(way_m - late)), 0
        )["handovers"]
        assert (values["expected"], values["missed"]) == (1, missed)
        assert values["furthest_m"] == pytest.approx(late_m, abs=SPEED_MPS * 0.1)


def test_a_change_to_a_foreign_channel_is_wrong() -> None:
    path_m = along(20.0, 180.0)
    values = train_metrics(
        SCENARIO, run(path_m, lambda way_m: 3 if 90.0 < way_m < 110.0 else 1), 0
    )["handovers"]
    # There and, back on its own channel, not.
    assert (values["expected"], values["wrong"]) == (0, 1)


def test_a_train_that_turns_back_at_a_station_owes_no_handover() -> None:
    path_m = np.concatenate([along(150.0, 210.0), along(210.0, 150.0)])
    values = train_metrics(SCENARIO, run(path_m, right_channel), 0)["handovers"]
    assert (values["expected"], values["missed"], values["wrong"]) == (0, 0, 0)
