"""Curves as text: which dots they are, and what stands around them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_corridor.cli.chart import charts, dots
from rail_corridor.cli.series import Series


def series(label: str, unit: str, times_s: list[float], values: list[float]) -> Series:
    made = Series(label, unit)
    made.times_s, made.values = times_s, values
    return made


def test_a_straight_line_from_corner_to_corner_is_the_diagonal() -> None:
    found = dots([0.0, 2.0], [0.0, 10.0], (0.0, 2.0, 0.0, 10.0), (8, 8))
    assert np.array_equal(found, np.eye(8, dtype=bool)[::-1])


def test_a_line_is_broken_where_nothing_is_known() -> None:
    values = [1.0, 1.0, math.nan, 1.0, 1.0]
    found = dots([0.0, 1.0, 2.0, 3.0, 4.0], values, (0.0, 4.0, 0.0, 1.0), (4, 9))
    assert found[0].tolist() == [True] * 3 + [False] * 3 + [True] * 3
    assert not found[1:].any()


def test_what_is_outside_the_window_is_left_out() -> None:
    found = dots([-1.0, 1.0], [0.0, 0.0], (0.0, 1.0, 0.0, 1.0), (4, 4))
    assert found[3].all() and not found[:3].any()
    assert not dots([5.0], [0.0], (0.0, 1.0, 0.0, 1.0), (4, 4)).any()


def test_each_unit_has_a_panel_with_its_limits_and_newest_values() -> None:
    curves = [
        series("/a.x_m", "m", [0.0, 4.0], [-2.0, 6.0]),
        series("/b.v_mps", "m/s", [0.0, 4.0], [3.0, 3.0]),
        series("/c.y_m", "m", [0.0, 4.0], [0.0, 1.5]),
    ]
    lines = charts(curves, (0.0, 4.0), 40, 24).plain.splitlines()
    assert [line.strip() for line in lines if "[" in line] == ["[m]", "[m/s]"]
    assert [line.strip() for line in lines if "─" in line] == [
        *("─ /a.x_m  6 m", "─ /c.y_m  1.5 m", "─ /b.v_mps  3 m/s")
    ]
    limits = [line.split("│")[0].strip() for line in lines if "│" in line]
    assert [text for text in limits if text] == ["6", "-2", "3.15", "2.85"]
    assert lines[-1].split() == ["0.0", "s", "4.0", "s"]
    assert len(lines) <= 24 and max(map(len, lines)) <= 40


@pytest.mark.parametrize("values", [[math.nan, math.nan], [0.0, 0.0]])
def test_there_is_a_chart_of_nothing(values: list[float]) -> None:
    assert "│" in charts([series("/a.x", "", [0.0, 0.0], values)], (0.0, 0.0), 5, 2).plain
