"""History, units and table reader: what is kept of a run, and how figures are written."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_corridor.equipment.column_text import ShownValue, shown_value
from rail_corridor.view.history import History
from rail_corridor.view.table_reader import TableReader
from rail_msgs_py.table import Table, TableWriter


def test_rows_are_a_step_apart_and_thinned_when_they_are_many() -> None:
    history = History(most_rows=8, step_s=0.5)
    for tick in range(200):
        history.put(0.25 * tick, [tick])
    times = [row[0] for row in history.rows]
    assert len(times) < 8
    assert times[0] == 0.0
    assert np.allclose(np.diff(times), history.step_s)
    assert history.step_s == 0.5 * 2**history.generation
    # The whole run is there, but for less than two steps at its end.
    assert 49.75 - times[-1] < 2 * history.step_s


def test_a_reader_gets_what_it_lacks_and_all_of_another_generation() -> None:
    history = History(most_rows=100)
    for second in range(10):
        history.put(float(second), [second])
    assert history.since(history.generation, 7) == (7, history.rows[7:])
    assert history.since(history.generation, 10) == (10, [])
    assert history.since(history.generation - 1, 7) == (0, history.rows)
    assert history.since(history.generation, 11) == (0, history.rows)
    assert history.since(history.generation, -1) == (0, history.rows)
    history.clear()
    assert history.since(history.generation - 1, 10) == (0, [])


@pytest.mark.parametrize(
    ("column", "value", "shown"),
    [
        ("permitted_mps", 10.0, ShownValue("permitted", "36.0", "km/h")),
        ("permitted_mps", math.inf, ShownValue("permitted", "unlimited", "")),
        ("end_of_authority_m", math.nan, ShownValue("end of authority", "none", "")),
        ("level_db", -3.04, ShownValue("level", "−3.0", "dB")),
        ("heading_rad", math.pi, ShownValue("heading", "180.00", "°")),
        ("variance_m2", 0.25, ShownValue("variance", "0.250", "m²")),
        ("acceleration_mps2", 0.5, ShownValue("acceleration", "0.50", "m/s²")),
        ("service_brake", 1.0, ShownValue("service brake", "yes", "")),
        ("valid", 0.0, ShownValue("valid", "no", "")),
        ("valid", math.nan, ShownValue("valid", "not known", "")),
        ("beacon_snr", 100.0, ShownValue("beacon snr", "20.0", "dB")),
        ("beacon_snr", 0.0, ShownValue("beacon snr", "none", "")),
        ("anything", 12345678.0, ShownValue("anything", "1.23457e+07", "")),
    ],
)
def test_the_name_of_a_column_says_how_it_is_written(
    column: str, value: float, shown: ShownValue
) -> None:
    assert shown_value(column, value) == shown


def test_tables_are_read_whatever_their_names_become() -> None:
    reader = TableReader()
    for columns in (("a_m", "b_s"), ("a_m", "b_s"), ("longer_name_m", "b_s"), ("a_m",)):
        writer = TableWriter(("train_a",), columns)
        values = np.arange(1.0, 1.0 + len(columns))[None]
        table = reader.read(writer.write(250_000_000, values))
        assert table.columns == columns
        assert (table.stamp_ns, table.rows) == (250_000_000, ("train_a",))
        assert np.array_equal(table.values, values)
    same = Table(7, ("x", "y"), ("a",), np.array([[1.0], [2.0]]))
    again = reader.read(TableWriter(same.rows, same.columns).write(7, same.values))
    assert np.array_equal(again.values, same.values)


def test_what_is_no_table_is_refused() -> None:
    from rail_msgs_py.waveform import Waveform

    reader = TableReader()
    with pytest.raises(ValueError, match="not a table"):
        reader.read(Waveform(0, 1.0, 0.0, 0, np.ones((1, 3), complex)).to_cdr())
