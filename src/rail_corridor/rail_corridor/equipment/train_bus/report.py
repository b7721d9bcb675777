"""From a run to values: frames of the train bus, and what its monitor reported of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from rail_corridor.equipment.tables import new_table
from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.train_bus import BUS_LINK, BUS_LINKS, BUS_STATE
from rail_signals.arrays import FloatArray
from rail_signals.train_bus.faults import KINDS
from rail_signals.train_bus.frame import bit_error_rate

from .section import BusFault
from .world import bus_fault_of, place_of_fault


def bus_metrics(scenario: Scenario, recording: RunData, index: int) -> dict[str, Any]:
    """Section ``train_bus`` of the train that is number `index` of those with a bus."""
    ticks, tick_s = recording.ticks, scenario.tick_s
    ends = [
        record.upto(ticks)[:, index]
        for record in (recording[BUS_LINK, "head"], recording[BUS_LINK, "tail"])
    ]
    state = recording[BUS_STATE].upto(ticks)[:, index]
    links = recording[BUS_LINKS].upto(ticks)[:, index]
    fault = bus_fault_of(scenario, recording[BUS_STATE].rows[index])
    first_loss_s = _first_loss_s(ends, tick_s)
    reports = _reports(scenario, fault, state)
    true = [r for r in reports if fault is not None and r["time_s"] >= fault.from_s]
    reported_s = true[0]["time_s"] if true else None
    lead_s = None
    if first_loss_s is not None and reported_s is not None:
        lead_s = first_loss_s - reported_s
    return {
        "train_bus": _frames(ends, links)
        | {
            "first_loss_s": first_loss_s,
            "end_not_confirmed_s": _not_confirmed_s(ends[0], tick_s),
            "measurements": int(_last(state, BUS_STATE.index["measurements"])),
            "interpretations": int(_last(state, BUS_STATE.index["interpretations"])),
            "faults": reports,
            "false_reports": len(reports) - len(true),
            "reported_s": reported_s,
            "reported_before_first_loss_s": lead_s,
        }
    }


def _frames(ends: list[FloatArray], links: FloatArray) -> dict[str, Any]:
    """Frames and bits, both ways together, and the errors that theory expects."""
    lost = sum(_last(end, BUS_LINK.index["lost"]) for end in ends)
    received = sum(_last(end, BUS_LINK.index["received"]) for end in ends)
    bits = sum(_last(end, BUS_LINK.index["bits"]) for end in ends)
    errors = sum(_last(end, BUS_LINK.index["bit_errors"]) for end in ends)
    ebn0_db = links[:, [BUS_LINKS.index["ebn0_tail_db"], BUS_LINKS.index["ebn0_head_db"]]]
    ebn0_db = ebn0_db[np.isfinite(ebn0_db)]
    expected = bit_error_rate(10.0 ** (ebn0_db / 10.0)) if ebn0_db.size else None
    return {
        "frames": int(received + lost),
        "lost": int(lost),
        "bits": int(bits),
        "bit_errors": int(errors),
        "bit_error_rate": errors / bits if bits else None,
        "bit_error_rate_bound": None if expected is None else float(np.mean(expected)),
        "ebn0_min_db": float(ebn0_db.min()) if ebn0_db.size else None,
    }


def _first_loss_s(ends: list[FloatArray], tick_s: float) -> float | None:
    """Time of the first frame that did not come through, None if all did."""
    losses = [np.flatnonzero(end[:, BUS_LINK.index["lost"]] > 0.0) for end in ends]
    first = [int(loss[0]) for loss in losses if loss.size]
    return min(first) * tick_s if first else None


def _not_confirmed_s(head: FloatArray, tick_s: float) -> float:
    """Time for which the head did not know that the end of the train was there."""
    return float(np.count_nonzero(head[:, BUS_LINK.index["other_end"]] == 0.0) * tick_s)


def _reports(scenario: Scenario, fault: BusFault | None, state: FloatArray) -> list[dict[str, Any]]:
    """Each time the monitor changed its mind on kind or level, towards a fault."""
    reported = state[:, [BUS_STATE.index["kind"], BUS_STATE.index["level"]]]
    reported = np.where(np.isnan(reported), 0.0, reported)
    before = np.concatenate((np.zeros((1, 2)), reported[:-1]))
    changed: NDArray[np.bool_] = (reported != before).any(axis=1) & (reported[:, 0] > 0.0)
    place_m = None if fault is None else place_of_fault(scenario, fault)
    reports = []
    for tick in np.flatnonzero(changed):
        row = state[tick]
        error_m = None if place_m is None else float(row[BUS_STATE.index["place_m"]] - place_m)
        reports.append(
            {
                "time_s": float(tick) * scenario.tick_s,
                "kind": KINDS[int(row[BUS_STATE.index["kind"]]) - 1],
                "level": ("ok", "warn", "error")[int(row[BUS_STATE.index["level"]])],
                "place_m": float(row[BUS_STATE.index["place_m"]]),
                "place_error_m": error_m,
                "size": _number(row[BUS_STATE.index["size"]]),
            }
        )
    return reports


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _last(table: FloatArray, column: int) -> float:
    """The last figure of a running count."""
    counts = table[:, column]
    counts = counts[~np.isnan(counts)]
    return float(counts[-1]) if counts.size else 0.0


def bus_table(trains: Mapping[str, Any]) -> Table | None:
    """What the buses carried, and what was reported of them; None without any."""
    with_bus = {name: train["train_bus"] for name, train in trains.items() if "train_bus" in train}
    if not with_bus:
        return None
    table = new_table(
        "train bus, and its monitor",
        *("train", "frames", "lost", "BER", "from s", "fault", "at m", "reported s"),
    )
    for name, bus in with_bus.items():
        last = bus["faults"][-1] if bus["faults"] else None
        rate = bus["bit_error_rate"]
        table.add_row(
            name,
            str(bus["frames"]),
            str(bus["lost"]),
            "-" if rate is None else f"{rate:.1e}",
            _time(bus["first_loss_s"]),
            "-" if last is None else last["kind"].replace("_", " "),
            "-" if last is None else f"{last['place_m']:.1f}",
            _time(bus["reported_s"]),
        )
    return table


def _time(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"
