"""Axle counters on the live page."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from axle_counter.corridor.subsystem import AXLE_COUNTER
from axle_counter.topics import SECTIONS
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from rail_corridor.plan.announcement import announcement
from rail_corridor.view.live_state import LiveStateStore
from rail_msgs_py.table import TableWriter
from rail_msgs_py.topics.world import SCENARIO


def state_of(scenario: Any) -> LiveStateStore:
    """Return what the page knows of a scenario when it has been announced."""
    made = LiveStateStore()
    made.feed(SCENARIO.name(), serialize_message(String(data=announcement(scenario))), 0.0)
    return made


def test_the_line_shows_points_sections_and_what_is_said_of_them(
    scenario: Callable[..., Any],
) -> None:
    state, view = state_of(scenario()), AXLE_COUNTER.live()
    (row,) = view.line_rows(state.line)
    assert [(mark.name, mark.at_m) for mark in row.marks] == [
        ("dp1", 200.0),
        ("dp2", 650.0),
        ("dp3", 1100.0),
    ]
    assert [(s.name, s.start_m, s.end_m) for s in row.stretches] == [
        ("acs1", 200.0, 650.0),
        ("acs2", 650.0, 1100.0),
    ]
    assert view.states(state) == {}  # nobody has said anything
    writer = TableWriter(("acs1", "acs2"), SECTIONS.columns)
    for said, words in (((0, 0), {}), ((1, 2), {"acs1": "occupied", "acs2": "not known"})):
        values = np.array([[said[0], 0.0], [said[1], np.nan]])
        state.feed(SECTIONS.name(), writer.write(0, values), 0.0)
        (shown,) = view.states(state).values()
        assert {name: each.word for name, each in shown.items()} == words


def test_a_line_without_axle_counters_has_no_row(scenario: Callable[..., Any]) -> None:
    state = state_of(scenario(axle_counters=None))
    assert AXLE_COUNTER.live().line_rows(state.line) == ()
