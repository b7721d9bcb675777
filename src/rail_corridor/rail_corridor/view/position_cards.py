"""Rows of the cards about positions on board, in words: localizer, Doppler shifts, what is told."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from rail_msgs_py.table import Table
from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.localizer import TOLD_POSITION
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.train_radio import REPORTS

from .located import Located
from .units import figure

Rows = list[list[str]]


def localizer_rows(said: Located) -> Rows:
    """What the localizer says."""
    rows = [["status", said.meaning, ""]]
    if said.known:
        rows = [
            ["front", f"{said.front_m:.2f}", f"m on {said.track}" if said.track else "m"],
            ["interval", f"{said.low_m:.1f} to {said.high_m:.1f}", "m"],
            ["protection level", f"{said.protection_m:.2f}", "m"],
            ["speed", f"{3.6 * said.speed_mps:.1f}".replace("-", "−"), "km/h"],
            *rows,
        ]
    if said.left_out:
        rows.append(["left out as faulty", ", ".join(said.left_out), ""])
    return rows


def doppler_rows(row: Mapping[str, float]) -> Rows:
    """A position by Doppler shifts, or why there is none."""
    reason, tones = int(row["reason"]), ["tones found", f"{row['tones']:.0f}", ""]
    if reason or not math.isfinite(row["chainage_m"]):
        from rail_signals.doppler.solver import Reason  # brings SciPy, which takes time to load

        names = {int(member): member.name for member in Reason}
        why = names.get(reason, f"reason {reason}").lower().replace("_", " ")
        return [["position", f"none: {why}", ""], tones]
    sigma_m, sigma_mps = (math.sqrt(row[column]) for column in ("chainage_m2", "speed_m2ps2"))
    offset = figure("offset_hz", row["offset_hz"])
    return [
        ["position", f"{row['chainage_m']:.2f} ± {2.0 * sigma_m:.2f}", "m (2σ)"],
        [
            "speed",
            f"{3.6 * row['speed_mps']:.2f} ± {7.2 * sigma_mps:.2f}".replace("-", "−"),
            "km/h",
        ],
        tones,
        ["offset of the receiver", offset.text, offset.unit],
    ]


def told_rows(row: Mapping[str, float]) -> Rows:
    """The position by phase ranging, as told to the train over the radio."""
    if not math.isfinite(row["position_m"]):
        return [["position", "none", ""]]
    return [
        ["position", f"{row['position_m']:.2f} ± {row['half_m']:.2f}", "m"],
        ["measured at", f"{row['time_s']:.2f}", "s"],
    ]


def report_rows(row: Mapping[str, float], tracks: Sequence[str]) -> Rows:
    """A location report that the zone controller has taken."""
    if not row["position_valid"] > 0.0:
        return [["position", "not known", ""]]
    segment = int(row["segment"])
    track = tracks[segment] if 0 <= segment < len(tracks) else f"segment {segment}"
    return [
        ["front", f"{row['offset_m']:.2f} ± {row['uncertainty_m']:.2f}", f"m on {track}"],
        ["speed", f"{3.6 * row['speed_mps']:.1f}".replace("-", "−"), "km/h"],
        ["length", f"{row['length_m']:.0f}", "m"],
        ["integrity", "confirmed" if row["integrity_confirmed"] > 0.0 else "not confirmed", ""],
        ["sealed at", f"{row['sealed_s']:.2f}", "s"],
    ]


def position_rows(kind: Topic | None, table: Table, tracks: Sequence[str]) -> Rows | None:
    """Rows of a table about positions; None if it is none, or of another version."""
    shown: tuple[tuple[Topic, tuple[str, ...], Callable[[Mapping[str, float]], Rows]], ...] = (
        (DOPPLER_FIX, DOPPLER_FIX.columns, doppler_rows),
        (TOLD_POSITION, TOLD_POSITION.columns, told_rows),
        (REPORTS, REPORTS.columns, lambda row: report_rows(row, tracks)),
    )
    for topic, columns, rows in shown:
        if kind is topic and table.columns == columns:
            if not table.rows:
                return [["report", "none in this tick", ""]]
            return rows(table.row(table.rows[-1]))
    return None
