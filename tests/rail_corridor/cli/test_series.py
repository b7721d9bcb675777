"""Series that `rail plot` draws: from a recording, by topic, field, row and unit."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from std_msgs.msg import String

from rail_corridor.cli.plot_picture import draw
from rail_corridor.cli.plots import plot_recording
from rail_corridor.cli.series import Gatherer, Trace, gather_from, panels_of, traces_in, unit_of
from rail_corridor.cli.usage import UsageError
from rail_corridor.errors import InputError
from rail_corridor.recording.parts import Recording
from rail_msgs_py.table import Table
from rail_msgs_py.topics.world import STATE


@pytest.fixture
def recording(made_up: Callable[..., Any]) -> Path:
    """Return the recording of a train at 20 m/s that moves 2 m each tick of 0.1 s."""
    run = made_up()
    run.write()
    path: Path = run.path
    return path


def gathered(path: Path, *texts: str) -> Gatherer:
    gatherer = Gatherer(trace for text in texts for trace in traces_in(text))
    with Recording(path) as file:
        gather_from(file, gatherer)
    return gatherer


def test_fields_of_a_recording(recording: Path) -> None:
    gatherer = gathered(
        recording,
        "/world/state.path_m,speed_mps",
        "/wayside/zone_controller/train_a/position.known",
    )
    way, speed, known = gatherer.series
    assert np.allclose(way.times_s, np.arange(60) * 0.1)
    assert np.allclose(way.values, 20.0 + 20.0 * np.asarray(way.times_s))
    assert speed.values == [20.0] * 60
    assert known.values == [float(tick % 9 != 4) for tick in range(60)]
    assert [each.unit for each in gatherer.series] == ["m", "m/s", ""]
    assert gatherer.span_s == pytest.approx((0.0, 5.9))


def test_a_picture_has_one_panel_for_each_unit(recording: Path, tmp_path: Path) -> None:
    texts = ("/world/state.path_m,speed_mps,chainage_m",)
    figure = Figure()
    draw(figure, gathered(recording, *texts).series, "run")
    assert [axes.get_ylabel() for axes in figure.axes] == ["[m]", "[m/s]"]
    assert [len(axes.lines) for axes in figure.axes] == [2, 1]
    out = tmp_path / "plot.png"
    assert plot_recording(traces_in(texts[0]), recording, out) == 0
    assert out.read_bytes().startswith(b"\x89PNG")


def test_without_a_picture_it_is_drawn_as_text(
    recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert plot_recording(traces_in("/world/state.speed_mps"), recording, None) == 0
    assert "/world/state.speed_mps  20 m/s" in capsys.readouterr().out


def test_a_topic_that_was_not_recorded_is_named(recording: Path) -> None:
    with pytest.raises(InputError, match=r"run\.mcap: /nobody was not recorded"):
        gathered(recording, "/nobody.x")


def test_rows_are_series_of_their_own() -> None:
    values = np.zeros((2, len(STATE.columns)))
    values[:, STATE.index["speed_mps"]] = 1.0, math.inf
    message = Table(2_000_000_000, ("a", "b"), STATE.columns, values).to_msg()
    gatherer = Gatherer([Trace("/world/state", "speed_mps"), Trace("/world/state", "b.path_m")])
    gatherer.take("/world/state", message)
    labels = [each.label for each in gatherer.series]
    assert labels == [f"/world/state.{name}" for name in ("a.speed_mps", "b.speed_mps", "b.path_m")]
    assert gatherer.series[0].values == [1.0]
    assert math.isnan(gatherer.series[1].values[0])
    assert [*panels_of(gatherer.series)] == ["m/s", "m"]


@pytest.mark.parametrize(
    ("field", "time_s", "line"),
    [("data", 1.0, "/a.data: is no number"), ("data", None, "/a: carries no time")],
)
def test_what_cannot_be_drawn_is_said(field: str, time_s: float | None, line: str) -> None:
    with pytest.raises(UsageError, match=line):
        Gatherer([Trace("/a", field)]).take("/a", String(data="x"), time_s)


@pytest.mark.parametrize(
    ("field", "unit"),
    [
        *(("speed_mps", "m/s"), ("a.b.power_dbm", "dBm"), ("time_s", "s"), ("row.x_m", "m")),
        *(("occupied", ""), ("m", ""), ("base_index", "")),
    ],
)
def test_a_name_ends_in_its_unit(field: str, unit: str) -> None:
    assert unit_of(field) == unit


@pytest.mark.parametrize("text", ["/a", "/a.", "a.b", "/a.b,", ""])
def test_what_names_no_field_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match=r"must be TOPIC\.field"):
        traces_in(text)


def test_a_window_forgets_what_is_older() -> None:
    gatherer = Gatherer([Trace("/a", "data")])
    series = gatherer._of(Trace("/a", "data"), None)
    series.times_s, series.values = [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]
    series.forget_before(2.0)
    assert (series.times_s, series.values) == ([2.0, 3.0], [5.0, 6.0])
