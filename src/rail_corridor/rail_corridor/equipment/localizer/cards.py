"""The localizer on the live page: its position, its protection level, what it has excluded."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from rail_corridor.equipment.live import LiveView
from rail_corridor.equipment.live_elements import (
    CardGroup,
    ErrorTrace,
    Gauge,
    Rows,
    TableCard,
    TrainCell,
    TrainColumn,
    TrainInterval,
    TrainRow,
    Writers,
    gauge,
)
from rail_corridor.equipment.live_state import LiveState
from rail_msgs_py.table import Table
from rail_msgs_py.topics.localizer import LOCALIZER_STATE, RELAYED_RANGE

from .live_estimate import LocalizerEstimate, error_of, estimate_of, read_estimate


def _state_rows(state: LiveState, train: str, row: Mapping[str, float]) -> Rows:
    return estimate_rows(read_estimate(row, 0, state.first_track(train)))


def _interval_gauge(state: LiveState, train: str, table: Table) -> Gauge | None:
    """The interval need not be even to both sides."""
    estimate, error = estimate_of(state, train), error_of(state, train)
    if estimate is None or error is None:
        return None
    shown = gauge(error[0], estimate.protection_m, "protection level")
    if shown is None:
        return None
    front_m = estimate.front_m
    return replace(shown, low_m=estimate.low_m - front_m, high_m=estimate.high_m - front_m)


class LocalizerView(LiveView):
    """What the localizer shows."""

    overview = (LOCALIZER_STATE,)
    columns = (
        TrainColumn(
            "localizer",
            "on board",
            "m",
            "what the localizer on board says from all sensors: the train is within so much, even "
            "if any one sensor is wrong",
            beside_position=True,
        ),
    )
    error_trace = ErrorTrace(
        "localizer",
        "Error of the localizer, said minus true; shaded: the interval it claims, which must hold "
        "0",
    )

    tables = (
        TableCard(
            LOCALIZER_STATE,
            "Localizer (on board, from all sensors)",
            CardGroup.ONBOARD_POSITION,
            _state_rows,
            _interval_gauge,
        ),
        TableCard(
            RELAYED_RANGE,
            "Position relayed by radio",
            CardGroup.ONBOARD_POSITION,
            lambda _state, _train, row: told_rows(row),
        ),
    )

    def train_row(self, state: LiveState, train: str, writers: Writers) -> TrainRow:
        """Its protection level, and its interval on the line."""
        estimate = estimate_of(state, train)
        if estimate is None:
            return TrainRow()
        gone = writers(LOCALIZER_STATE.name(train=train)) == 0
        interval = None
        if estimate.known:
            label = "interval of the localizer: see “100 m”"
            interval = TrainInterval(
                estimate.track, round(estimate.low_m, 3), round(estimate.high_m, 3), label
            )
        values = _values(state, train, estimate, gone=gone)
        cells = {"localizer": _cell(estimate, gone=gone, holds=values.get("holds"))}
        return TrainRow(cells, interval, values={"located": values})

    def error(self, state: LiveState, train: str) -> tuple[float, float, float] | None:
        """See `LiveView.error`."""
        return error_of(state, train)


def estimate_rows(estimate: LocalizerEstimate) -> Rows:
    """What the localizer says."""
    rows = [["status", estimate.meaning, ""]]
    if estimate.known:
        track = estimate.track
        rows = [
            ["front", f"{estimate.front_m:.2f}", f"m on {track}" if track else "m"],
            ["interval", f"{estimate.low_m:.1f} to {estimate.high_m:.1f}", "m"],
            ["protection level", f"{estimate.protection_m:.2f}", "m"],
            ["speed", f"{3.6 * estimate.speed_mps:.1f}".replace("-", "−"), "km/h"],
            *rows,
        ]
    if estimate.left_out:
        rows.append(["left out as faulty", ", ".join(estimate.left_out), ""])
    return rows


def told_rows(row: Mapping[str, float]) -> Rows:
    """The position by phase ranging, as told to the train over the radio."""
    if not math.isfinite(row["position_m"]):
        return [["position", "none", ""]]
    return [
        ["position", f"{row['position_m']:.2f} ± {row['half_m']:.2f}", "m"],
        ["measured at", f"{row['time_s']:.2f}", "s"],
    ]


def _cell(estimate: LocalizerEstimate, *, gone: bool, holds: bool | None) -> TrainCell:
    left_out = f"without {', '.join(estimate.left_out)}" if estimate.left_out else ""
    text = f"± {estimate.protection_m:.1f}" if estimate.known else "not known"
    if gone or holds is False or estimate.status == "unavailable":
        return TrainCell("gone" if gone else text, "bad", left_out)
    doubtful = estimate.status == "unmonitored" or left_out
    return TrainCell(text, "warned" if doubtful else "", left_out)


def _values(
    state: LiveState, train: str, estimate: LocalizerEstimate, *, gone: bool
) -> dict[str, Any]:
    age_s = max(0.0, (state.now_ns - estimate.stamp_ns) * 1e-9)
    values: dict[str, Any] = {
        "status": estimate.status,
        "reason": estimate.reason,
        "left_out": estimate.left_out,
        "track": estimate.track,
        "age_s": round(age_s, 2),
        "gone": gone,
    }
    if estimate.known:
        error = error_of(state, train)
        values |= {
            "at_m": round(estimate.front_m, 3),
            "low_m": round(estimate.low_m, 3),
            "high_m": round(estimate.high_m, 3),
            "protection_m": round(estimate.protection_m, 3),
            "error_m": None if error is None else round(error[0], 3),
            "holds": None if error is None else error[1] <= 0.0 <= error[2],
        }
    return values
