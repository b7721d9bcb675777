"""The report of a run: one JSON object, and a table of the same on the screen."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from rail_corridor.equipment.doppler.report import positioning_metrics
from rail_corridor.equipment.ranging.report import train_metrics
from rail_corridor.equipment.track_code.report import code_metrics
from rail_corridor.equipment.train_bus.report import bus_metrics, print_buses
from rail_corridor.equipment.train_radio.report import cbtc_metrics
from rail_corridor.equipment.train_radio.threat_metrics import threat_metrics
from rail_corridor.run.plan import Plan
from rail_corridor.scenario.model import Scenario

from .intake import Intake

_MOST_EVENTS_SHOWN = 8


def make_report(
    scenario: Scenario,
    plan: Plan,
    intake: Intake,
    *,
    nodes: int,
    processes: int,
    interrupted: bool,
) -> dict[str, Any]:
    """Report of what has been read of a run, while it went or from a file.

    The wall time is None where nobody has measured it.
    """
    recording = intake.recording
    ticks = recording.ticks
    wall_s: float | None = intake.last_tick_s - intake.first_tick_s if ticks else 0.0
    if wall_s is not None:
        wall_s = None if math.isnan(wall_s) else max(wall_s, 0.0)
    sim_s = ticks * plan.tick_s
    # Of a run that was stopped, what happened after the last whole tick is left out.
    end_s = sim_s if interrupted else math.inf
    trains = {}
    for index, name in enumerate(recording.trains):
        section = train_metrics(scenario, recording, index)
        unit = plan.transponders[name]
        section["phase_ranging"]["calibration_residual_m"] = unit.residual_m
        if recording.circuits:
            section |= code_metrics(scenario, recording, index)
        if recording.cbtc:
            section |= cbtc_metrics(scenario, recording, index)
        section |= positioning_metrics(scenario, recording, index)
        if name in recording.buses:
            section |= bus_metrics(scenario, recording, recording.buses.index(name))
        trains[name] = section
    threats = {"threats": threat_metrics(recording)} if recording.threatened else {}
    return {
        "scenario": plan.scenario,
        "seed": plan.seed,
        "ticks": ticks,
        "sim_time_s": round(sim_s, 9),
        "wall_time_s": wall_s,
        "real_time_factor": sim_s / wall_s if wall_s else None,
        "nodes": nodes,
        "processes": processes,
        "complete": not interrupted,
        "missing_ticks": recording.missing_ticks,
        "digest": recording.digest(),
        "failures": intake.failures,
        "events": [e for e in intake.events if e["level"] != "ok" and e["time_s"] < end_s],
        **threats,
        "trains": trains,
    }


def report_text(report: dict[str, Any]) -> str:
    """The report as JSON."""
    return json.dumps(report, indent=2, allow_nan=False) + "\n"


def write_report(report: dict[str, Any], path: Path) -> None:
    """Write the report so that a reader finds the old one or the new one, never half of one."""
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    draft.write_text(report_text(report))
    draft.replace(path)


def print_report(report: dict[str, Any], console: Console) -> None:
    """Show the report as a table."""
    table = Table(title=_title(report), title_justify="left", title_style="bold")
    headings = ("train", "km", "handovers", "known", "RMSE m", "bound m", "95 % m", "max m")
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "train" else "right", no_wrap=True)
    for name, train in report["trains"].items():
        ranging, changes = train["phase_ranging"], train["handovers"]
        problems = [f"{changes[key]} {key}" for key in ("missed", "wrong") if changes[key]]
        table.add_row(
            name,
            f"{train['distance_m'] / 1000.0:.2f}",
            f"{changes['made']} of {changes['expected']}" + "".join(f", {p}" for p in problems),
            _percent(ranging["availability"]),
            *(_metres(ranging[key]) for key in ("rmse_m", "bound_m", "p95_m", "max_m")),
        )
    console.print(table)
    _print_codes(report["trains"], console)
    _print_authorities(report["trains"], console)
    _print_threats(report, console)
    _print_positions(report["trains"], console)
    print_buses(report["trains"], console)
    factor = report["real_time_factor"]
    speed = f"{factor:.1f} times real time, " if factor else ""
    wall_s = report["wall_time_s"]
    wall = "" if wall_s is None else f" in {wall_s:.1f} s"
    console.print(
        f"{report['ticks']} ticks, {report['sim_time_s']:.1f} s simulated{wall}: "
        f"{speed}{report['nodes']} nodes in "
        f"{report['processes']} {'process' if report['processes'] == 1 else 'processes'}",
        soft_wrap=True,
    )
    console.print(f"digest {report['digest'][:16]} (the same for every placement and rate)")
    for failed in report["failures"]:
        console.print(
            f"[red]failed[/red] {failed['node']} at {failed['time_s']:.1f} s: {failed['reason']}"
            f" (noticed by {failed['detected_by']})",
            soft_wrap=True,
        )
    _print_events(report["events"], console)


def _print_codes(trains: dict[str, Any], console: Console) -> None:
    """Show what trains understood from the rails, and what supervision did."""
    obeying = {name: train for name, train in trains.items() if "track_code" in train}
    if not obeying:
        return
    table = Table(
        title="codes understood, and supervision", title_justify="left", title_style="bold"
    )
    headings = (
        "train",
        "codes",
        "wrong",
        "valid",
        "after s",
        "braked",
        "over s",
        "entered",
        "gap m",
    )
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "train" else "right", no_wrap=True)
    for name, train in obeying.items():
        code, atp = train["track_code"], train["atp"]
        margin_m = atp["margin_min_m"]
        table.add_row(
            name,
            f"{code['decoded']}/{code['sent']}",
            str(code["wrong"]),
            "-" if code["availability"] is None else f"{100.0 * code['availability']:.0f} %",
            "-" if code["latency_s"] is None else f"{code['latency_s']:.2f}",
            str(atp["interventions"]),
            f"{atp['overspeed_s']:.1f}",
            str(atp["entered_occupied"]),
            "-" if margin_m is None else f"{margin_m:.0f}",
        )
    console.print(table)


def _print_authorities(trains: dict[str, Any], console: Console) -> None:
    """Show what the train radio brought, and what supervision did."""
    obeying = {name: train for name, train in trains.items() if "cbtc" in train}
    if not obeying:
        return
    title = "movement authorities by radio, and supervision"
    table = Table(title=title, title_justify="left", title_style="bold")
    headings = ("train", "frames", "lost", "age 95 % s", "braked", "emerg.", "passed", "gap m")
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "train" else "right", no_wrap=True)
    for name, train in obeying.items():
        link, atp = train["cbtc"], train["atp"]
        margin_m, age_s = atp["margin_min_m"], link["age_p95_s"]
        table.add_row(
            name,
            str(link["frames"]),
            f"{100.0 * link['lost'] / link['frames']:.1f} %" if link["frames"] else "-",
            "-" if age_s is None else f"{age_s:.2f}",
            str(atp["interventions"]),
            str(atp["emergency_brakes"]),
            str(atp["passed_authority"]),
            "-" if margin_m is None else f"{margin_m:.0f}",
        )
    console.print(table)


def _print_threats(report: dict[str, Any], console: Console) -> None:
    """Show what an intruder on the network did, and what came of it."""
    if "threats" not in report:
        return
    threats = report["threats"]
    strikes = ", ".join(f"{name} {count}" for name, count in threats["strikes"].items())
    links = [train["cbtc"] for train in report["trains"].values()]
    rejected = sum(link["rejected"] for link in links)
    authorities = sum(link["forged_accepted"] for link in links)
    reports = sum(link["forged_reports"] for link in links)
    console.print(
        f"threats to {threats['frames']} frames: {strikes}; {rejected} rejected, forged and taken:"
        f" {authorities} authorities, {reports} reports",
        soft_wrap=True,
        highlight=False,
    )


def _print_positions(trains: dict[str, Any], console: Console) -> None:
    """Show what trains found out about their place by themselves."""
    title = "positions on board, in metres"
    table = Table(title=title, title_justify="left", title_style="bold")
    headings = ("train", "by", "known", "RMSE", "bound", "95 %", "max", "level", "over")
    for heading in headings:
        left = heading in ("train", "by")
        table.add_column(heading, justify="left" if left else "right", no_wrap=True)
    for name, train in trains.items():
        for key, label in (("doppler", "Doppler"), ("localizer", "all sensors")):
            if key not in train:
                continue
            found = train[key]
            level_m = found.get("protection_level_m")
            table.add_row(
                name,
                label,
                _percent(found["availability"]),
                *(_metres(found.get(column)) for column in ("rmse_m", "bound_m", "p95_m", "max_m")),
                "" if level_m is None else f"{level_m:.1f}",
                str(found.get("exceeded", "")),
            )
    if table.row_count:
        console.print(table)


def _print_events(events: list[dict[str, Any]], console: Console) -> None:
    for event in events[:_MOST_EVENTS_SHOWN]:
        console.print(
            f"[yellow]{event['level']}[/yellow] {event['time_s']:8.1f} s  "
            f"{event['name']}: {event['message']}",
            soft_wrap=True,
            highlight=False,
        )
    if len(events) > _MOST_EVENTS_SHOWN:
        rest = len(events) - _MOST_EVENTS_SHOWN
        console.print(f"... and {rest} more events in the JSON report (--report FILE.json)")


def _title(report: dict[str, Any]) -> str:
    state = "" if report["complete"] else " (stopped early)"
    return f"{report['scenario']}, seed {report['seed']}{state}: position by phase ranging"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:.1f} %"


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
