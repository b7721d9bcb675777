"""``rail plot``: fields over simulated time, in the terminal or as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rclpy.task import Future
from rich.console import Console
from rich.live import Live

from rail_corridor.errors import InputError

from .fields import stamp_of
from .graph import graph_of, spin_node
from .live_tools import subscribe
from .series import Gatherer, Series, Trace

_REDRAW_S = 0.2
_HEIGHT = 24
#: A message so much older than the one before is of another run [s].
_RESTART_S = 1.0


class PlotOptions(NamedTuple):
    """How a plot is made.

    Parameters
    ----------
    out : Path, optional
        File of the picture; in the terminal if not given.
    last_s : float
        Simulated time that the terminal shows while a corridor runs.
    seconds : float, optional
        Simulated time after which a live plot ends; until interrupted if not given.
    """

    out: Path | None
    last_s: float
    seconds: float | None


def plot_recording(traces: Sequence[Trace], path: Path, out: Path | None) -> int:
    """Plot from a recording; returns the exit code.

    Raises
    ------
    InputError, UsageError
    """
    from rail_corridor.recording.parts import Recording

    from .series import gather_from

    gatherer = Gatherer(traces)
    with Recording(path) as file:
        gather_from(file, gatherer)
    if gatherer.span_s is None:
        raise InputError("nothing to plot was recorded", file=str(path))
    _finish(gatherer, path.name, out)
    return 0


def plot_live(traces: Sequence[Trace], options: PlotOptions) -> int:
    """Plot what a running corridor publishes; returns the exit code.

    Raises
    ------
    UsageError
        If a message has not the field that is wanted.
    """
    gatherer = Gatherer(traces)
    console = Console()
    done = Future()
    begun_s: list[float] = []
    newest_s: dict[str, float] = {}

    def is_enough() -> bool:
        span_s = gatherer.span_s
        if span_s is None or options.seconds is None:
            return False
        begun_s[:] = begun_s or [span_s[0]]
        return span_s[1] - begun_s[0] >= options.seconds

    with graph_of("rail_plot") as graph:
        errors: list[Exception] = []
        for topic in gatherer.topics:

            def take(message: Any, topic: str = topic) -> None:
                stamp_s = stamp_of(message)
                if stamp_s is not None:
                    if stamp_s < newest_s.get(topic, stamp_s) - _RESTART_S:
                        gatherer.clear()
                        begun_s.clear()
                    newest_s[topic] = stamp_s
                gatherer.take(topic, message)

            code = subscribe(graph, topic, take, is_enough, done, errors)
            if code:
                return code
        if options.out is not None:
            spin_node(graph.node, done)
        else:
            _show_live(graph.node, gatherer, options, console, done)
    if errors:
        raise errors[0]
    if gatherer.span_s is None:
        console.print("no message came")
        return 1
    if options.out is not None:
        _finish(gatherer, "live", options.out)
    return 0


def _show_live(
    node: Any, gatherer: Gatherer, options: PlotOptions, console: Console, done: Future
) -> None:
    with Live(console=console, auto_refresh=False) as live:

        def show() -> None:
            span_s = gatherer.span_s
            if span_s is None:
                return
            begin_s = max(span_s[0], span_s[1] - options.last_s)
            for each in gatherer.series:
                each.forget_before(begin_s)
            live.update(_chart(gatherer.series, (begin_s, span_s[1]), console), refresh=True)

        node.create_timer(_REDRAW_S, show)
        spin_node(node, done)
        show()
    if not console.is_terminal:  # where the last frame has no end of line
        print()


def _chart(series: Sequence[Series], span_s: tuple[float, float], console: Console) -> Any:
    from .chart import charts

    height = min(console.height - 1, _HEIGHT) if console.is_terminal else _HEIGHT
    return charts(series, span_s, console.width, height)


def _finish(gatherer: Gatherer, title: str, out: Path | None) -> None:
    if out is None:
        assert gatherer.span_s is not None
        console = Console()
        console.print(_chart(gatherer.series, gatherer.span_s, console))
        return
    from .plot_picture import draw_series

    draw_series(gatherer.series, title, out)
    print(out)
