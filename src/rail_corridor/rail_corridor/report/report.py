"""The report of a run: one JSON object, and a table of the same on the screen."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

from rich.console import Console

from rail_corridor.equipment.registry import subsystems
from rail_corridor.plan.plan import Plan
from rail_corridor.scenario.model import Scenario

from .intake import Intake
from .verdict import event_counts, verdict_of

_MOST_EVENTS_SHOWN = 8
_FILE_WIDTH = 140


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
    trains: dict[str, dict[str, Any]] = {name: {} for name in recording.trains}
    run: dict[str, Any] = {}
    for subsystem in subsystems():
        run |= subsystem.run_report(scenario, recording)
        for index, section in enumerate(trains.values()):
            section |= subsystem.train_report(scenario, recording, index)
    said = [e for e in intake.events if e["level"] != "ok" and e["time_s"] < end_s]
    said += [
        {"level": "error", "name": f"{subsystem.name}: {event['kind']}, {event['train']}"} | event
        for subsystem in subsystems()
        for event in subsystem.events(scenario, recording)
    ]
    events = sorted(said, key=lambda event: (event["time_s"], event["name"]))
    report = {
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
        "events": events,
        "event_counts": event_counts(events),
        **run,
        "trains": trains,
    }
    verdict = verdict_of(report)
    return report | {"verdict": verdict.word, "reasons": list(verdict.reasons)}


def report_text(report: dict[str, Any]) -> str:
    """The report as JSON."""
    return json.dumps(report, indent=2, allow_nan=False) + "\n"


def write_report(report: dict[str, Any], path: Path) -> None:
    """Write the report so that a reader finds the old one or the new one, never half of one."""
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    draft.write_text(report_text(report))
    draft.replace(path)


def print_report(report: dict[str, Any], console: Console) -> None:
    """Show the report as tables; no number is cut off where it goes to a file."""
    width = None if console.is_terminal else max(console.width, _FILE_WIDTH)
    for subsystem in subsystems():
        for part in subsystem.tables(report):
            soft = isinstance(part, str)
            console.print(part, soft_wrap=soft, highlight=False, width=None if soft else width)
    factor = report["real_time_factor"]
    speed = f"{factor:.1f} times real time, " if factor else ""
    wall_s = report["wall_time_s"]
    wall = "" if wall_s is None else f" in {wall_s:.1f} s"
    plural = "process" if report["processes"] == 1 else "processes"
    nodes = f"{report['nodes']} nodes in {report['processes']} {plural}"
    if not report["nodes"]:
        nodes = "nodes that were started elsewhere"
    console.print(
        f"{report['ticks']} ticks, {report['sim_time_s']:.1f} s simulated{wall}: {speed}{nodes}",
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


def print_verdict(report: dict[str, Any], console: Console) -> None:
    """Say in one line whether the run was safe, unsafe or not live, and why."""
    colour = {"safe": "green", "unsafe": "red", "not live": "yellow"}[report["verdict"]]
    reasons = "; ".join(report["reasons"])
    line = f"[bold {colour}]{report['verdict']}[/bold {colour}]" + (
        f": {reasons}" if reasons else ""
    )
    console.print(line, soft_wrap=True, highlight=False)


def _print_events(events: list[dict[str, Any]], console: Console) -> None:
    grave = sorted(events, key=lambda event: event["level"] != "error")[:_MOST_EVENTS_SHOWN]
    for event in sorted(grave, key=lambda event: event["time_s"]):
        console.print(
            f"[yellow]{event['level']}[/yellow] {event['time_s']:8.1f} s  "
            f"{event['name']}: {event['message']}",
            soft_wrap=True,
            highlight=False,
        )
    if len(events) > _MOST_EVENTS_SHOWN:
        rest = len(events) - _MOST_EVENTS_SHOWN
        console.print(f"... and {rest} more events in the JSON report (--report FILE.json)")
