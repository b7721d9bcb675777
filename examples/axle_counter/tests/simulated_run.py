"""A run without ROS: world, medium, detection points, sections and report, one after the other."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from axle_counter.corridor.nodes import sensors_of
from axle_counter.corridor.placement import layout_of
from axle_counter.corridor.report import axle_counter_metrics
from axle_counter.corridor.section import AXLE_COUNTERS
from axle_counter.corridor.truth import empty_at_start
from axle_counter.signals.axle_detector import AxleDetector, Passages
from axle_counter.signals.section_counter import Reset, Section, SectionCounter
from axle_counter.topics import PASSAGES, SECTIONS
from axle_counter.world.medium import Motion, WheelSensorMedium

from rail_corridor.plan.plan import run_data_of
from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.world import STATE
from rail_world.trains.traffic import Traffic

#: What may happen to the sections after a tick: its number, the sections by name.
Incident = Callable[[int, dict[str, SectionCounter]], None]


def simulate(scenario: Scenario, incident: Incident = lambda tick, sections: None) -> RunData:
    """Run a scenario to its end; only what the axle counter is concerned with."""
    described, plan, layout = sensors_of(scenario), AXLE_COUNTERS.of(scenario), layout_of(scenario)
    assert described is not None and plan is not None
    traffic = Traffic(scenario.trains, scenario.network, scenario.tick_s)
    medium = WheelSensorMedium(
        described, scenario.trains, scenario.network, scenario.seed, scenario.tick_s
    )
    detectors = [AxleDetector(plan.sensor) for _ in layout.points]
    sections = {
        each.name: SectionCounter(Section(each.name, dict(each.borders)))
        for each in layout.sections
    }
    data = run_data_of(scenario)
    columns = [STATE.index[name] for name in ("path_m", "speed_mps", "on_line")]
    for tick in range(scenario.ticks):
        if tick:
            traffic.step()
        state = traffic.state()
        data[STATE].put(tick, slice(None), state)
        motions = [Motion(*row[:2], row[2] > 0.0) for row in state[:, columns].tolist()]
        seen: dict[str, Passages] = {}
        blocks = medium.blocks(tick, motions)
        for index, point in enumerate(layout.points):
            found = seen[point.name] = detectors[index].feed(blocks[index])
            values = (found.forward, found.backward, found.unclear, found.busy, found.valid)
            data[PASSAGES].put(tick, index, np.array(values, dtype=float))
        for section in sections.values():
            section.update(seen)
        for name in empty_at_start(scenario, plan) if tick == 0 else ():
            assert sections[name].reset(Reset.CONDITIONAL)
        incident(tick, sections)
        said = [(each.occupancy, each.axles) for each in sections.values()]
        data[SECTIONS].put(tick, slice(None), np.array(said, dtype=float))
    return data


def judged(scenario: Scenario, **options: Any) -> dict[str, Any]:
    """Return the section of the report that a run of a scenario makes."""
    report = axle_counter_metrics(scenario, simulate(scenario, **options))["axle_counter"]
    assert isinstance(report, dict)
    return report
