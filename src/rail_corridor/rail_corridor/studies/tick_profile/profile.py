"""``rail profile``: runs a scenario in one process, and shows where its ticks spend their time."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from rich.console import Console

from rail_corridor.run.launcher import run
from rail_corridor.run.options import RunOptions
from rail_corridor.scenario.model import Scenario

from .cost_table import TickCosts, costs_of, print_costs
from .flame_graph import write_flame_graph
from .probe import TickProbe
from .schedule import Schedule


def profile(scenario: Scenario, flame: Path | None, rows: Path | None, console: Console) -> int:
    """Run a scenario and show its profile; returns the exit code, that of the run.

    Parameters
    ----------
    scenario : Scenario
    flame : Path, optional
        File of the flame graph.
    rows : Path, optional
        JSON file of the figures.
    console : Console
    """
    probe = TickProbe(Schedule(scenario.ticks))
    try:
        code = run(scenario, RunOptions(placement="one", probe=probe.attach), console)
    finally:
        probe.finish()
    if not probe.complete:
        print("rail: the run has ended before there was anything to profile", file=sys.stderr)
        return code or 1
    costs = tick_costs(scenario, probe)
    title = f"{scenario.name}, seed {scenario.seed}: where a tick goes"
    print_costs(costs, title, console)
    if flame is not None:
        write_flame_graph(probe.sampler.cpu_s(), probe.attribute, title, flame)
        look = "www.speedscope.app, Left Heavy" if flame.suffix == ".json" else "Timeline"
        line = f"flame graph written to {flame} (choose {look}; its x axis is a sum of time)"
        console.print(line, highlight=False, soft_wrap=True)
    if rows is not None:
        rows.write_text(json.dumps({"scenario": scenario.name, **costs.values()}, indent=2) + "\n")
    return code


def tick_costs(scenario: Scenario, probe: TickProbe) -> TickCosts:
    """What a probe has found, and the floors, which are measured here."""
    plain_s, sampled_s = probe.tick_s("plain"), probe.tick_s("sampled")
    samples = (
        (whose.kind, whose.stage, seconds)
        for stack, seconds in probe.sampler.cpu_s()
        for whose in (probe.attribute(stack),)
    )
    return TickCosts(
        rows=costs_of(samples, probe.nodes, 1e3 * plain_s),
        tick_s=scenario.tick_s,
        tick_ms=1e3 * plain_s,
        wall_tick_ms=1e3 * probe.wall_tick_s("plain"),
        sampling=sampled_s / plain_s - 1.0,
        samples=probe.sampler.samples,
        hand_over_ms=1e3 * probe.hand_over_floor_s(),
        middleware_ms=1e3 * probe.middleware_floor_s(),
        arithmetic_ms=1e3 * probe.arithmetic_floor_s(),
    )
