"""From a run to values: threats on the network, and whether any end believed them."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil
from typing import Any

import numpy as np

from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.train_radio import ATP_STATE, AUTHORITY, REPORTS, STRIKES
from rail_msgs_py.train_radio.fixed_point import covering
from rail_msgs_py.train_radio.train_report import PER_METRE, PER_METRE_COARSE, WIDEST_M
from rail_signals.arrays import FloatArray

#: Times on the wire are whole microseconds.
_SAME_S = 2e-6
#: What rounding on the wire may take off an authority [m].
_ROUNDING_M = 0.011


def threat_metrics(recording: RunData) -> dict[str, Any]:
    """Section ``threats``: frames carried by the backbone, and how often each threat struck."""
    table = recording[STRIKES].upto(recording.ticks)[:, 0]
    table = table[~np.isnan(table[:, 0])]
    last = table[-1] if len(table) else np.zeros(len(STRIKES.columns))
    frames, *strikes = last.astype(int).tolist()
    return {"frames": frames, "strikes": dict(zip(STRIKES.columns[1:], strikes, strict=True))}


def threat_line(report: Mapping[str, Any]) -> str | None:
    """What an intruder on the network did, and what came of it, in words; None without one."""
    if "threats" not in report:
        return None
    threats = report["threats"]
    strikes = ", ".join(f"{name} {count}" for name, count in threats["strikes"].items())
    links = [train["cbtc"] for train in report["trains"].values()]
    rejected = sum(link["rejected"] for link in links)
    authorities = sum(link["forged_accepted"] for link in links)
    reports = sum(link["forged_reports"] for link in links)
    return (
        f"threats to {threats['frames']} frames: {strikes}; {rejected} rejected, forged and"
        f" accepted: {authorities} authorities, {reports} reports"
    )


def forged_authorities(tick_s: float, atp: FloatArray, issued: FloatArray) -> int:
    """Authorities in force on board that the zone controller has not given to this train.

    ``atp`` and ``issued`` are its tables [tick, column]. A genuine one has an end that was given
    since the earliest time at which it can have been sealed, which is what the train knows, and
    before it came. Where one of these ticks of the controller is not on record, as when it died,
    any end that it ever gave will do.
    """
    end_m, age_s = (
        atp[:, ATP_STATE.index["end_of_authority_m"]],
        atp[:, ATP_STATE.index["authority_age_s"]],
    )
    first: dict[tuple[float, float], int] = {}
    for tick in np.flatnonzero(np.isfinite(end_m) & np.isfinite(age_s)).tolist():
        first.setdefault((round(tick * tick_s - age_s[tick], 6), float(end_m[tick])), tick)
    issued_m = issued[:, AUTHORITY.index["end_of_authority_m"]]
    silent = np.isnan(issued[:, AUTHORITY.index["accepted"]])
    ever_m = issued_m[np.isfinite(issued_m)]
    forged = 0
    for (sealed_s, reported_m), tick in first.items():
        since = _first_tick(sealed_s, tick_s)
        until = max(since + 1, tick)
        if not 0 <= since <= tick:
            forged += 1
            continue
        wanted_m = ever_m if silent[since:until].any() else issued_m[since:until]
        forged += not np.any(np.abs(wanted_m - reported_m) <= _ROUNDING_M)
    return forged


def _first_tick(time_s: float, tick_s: float) -> int:
    """First tick that is not before a time."""
    return ceil((time_s - _SAME_S) / tick_s)


def report_metrics(scenario: Scenario, recording: RunData, index: int) -> dict[str, int]:
    """Location reports that the zone controller took from a train, and those not given by it.

    A genuine one tells, to the last bit, where the train believed to be at a time since it can
    have been sealed, is of this train on its track, comes after all that were taken before it, and
    is no older than the safe channel allows. The speed is not compared: what the odometer said is
    not on record. A report of ticks whose belief is not on record is not judged, unless the train
    was silent by then.
    """
    believed = recording[ATP_STATE].upto(recording.ticks)[:, index]
    recorded = ~np.isnan(believed[:, ATP_STATE.index["accepted"]])
    silent = 2 + max(np.flatnonzero(recorded).tolist(), default=-1)
    train = scenario.trains[index]
    own = {
        "train": index + 1,
        "segment": list(scenario.tracks).index(train.route[0]),
        "direction": 1,
        "integrity_confirmed": 1,
    }
    accepted = forged = 0
    newest = -1
    oldest_s = max(1.0, 3.0 * scenario.tick_s) + _SAME_S
    for tick, row in recording.events(REPORTS).of(index, recording.ticks):
        accepted += 1
        sealed_s = row[REPORTS.index["sealed_s"]]
        since = max(newest + 1, _first_tick(sealed_s, scenario.tick_s))
        ticks = range(since, min(tick + 1, silent))
        named = all(row[REPORTS.index[name]] == value for name, value in own.items())
        told = [
            then
            for then in ticks
            if then >= len(recorded)
            or not recorded[then]
            or (named and _same_place(row, believed[then]))
        ]
        if not told or tick * scenario.tick_s - sealed_s > oldest_s:
            forged += 1
        newest = told[0] if told else max(newest, since)
    return {"reports_taken": accepted, "forged_reports": forged}


def _same_place(report: FloatArray, believed: FloatArray) -> bool:
    """Whether a report tells the place that a train believed in, as it is written on the wire."""
    front_m, half_m = (
        believed[ATP_STATE.index["front_m"]],
        believed[ATP_STATE.index["uncertainty_m"]],
    )
    valid = bool(report[REPORTS.index["position_valid"]])
    if np.isnan(front_m):
        return not valid
    at, half = covering(front_m, half_m, PER_METRE, PER_METRE_COARSE)
    if half / PER_METRE_COARSE > WIDEST_M:
        return not valid
    reported = report[REPORTS.index["offset_m"]], report[REPORTS.index["uncertainty_m"]]
    return valid and reported == (at / PER_METRE, half / PER_METRE_COARSE)
