"""Runs a corridor: starts its processes, watches them, ends them, makes the report."""

from __future__ import annotations

import gc
import os
import shutil
import signal
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from .domain import sole_corridor
from .host import make_nodes, node_class, run_nodes
from .kills import Executioner, Kill, check_kills
from .middleware import discover_on
from .plan import WORLD, Placement, Plan, check_external, make_plan
from .processes import ProcessGroup, remove_orphaned_segments
from .report import make_report, print_report, write_report
from .scenario import Scenario

#: More processes than this to a core cost more than they show.
MOST_PROCESSES_PER_CORE = 8
#: Wall time to read what is still under way when the world has finished.
DRAIN_S = 20.0


@dataclass(frozen=True)
class RunOptions:
    """How to run a scenario, apart from what is in it."""

    rate: float = 0.0
    placement: Placement | None = None
    only: Literal["wayside", "onboard"] | None = None
    report: Path | None = None
    timeout_s: float = 30.0
    external: tuple[str, ...] = ()
    kills: tuple[Kill, ...] = ()


def run(scenario: Scenario, options: RunOptions, console: Console) -> int:
    """Run a scenario to its end, or until interrupted.

    Returns
    -------
    int
        Exit code: 0, 1 if the world itself failed, 128 + the number of the signal that ended it.
    """
    discover_on("all" if options.only else "this")
    directory = Path(tempfile.mkdtemp(prefix="rail_corridor_"))
    try:
        plan = make_plan(
            scenario,
            directory,
            rate=options.rate,
            timeout_s=options.timeout_s,
            external=options.external,
        )
        check_external(plan, options.external)
        with sole_corridor(options.only):
            return _Run(scenario, options, plan, console).run()
    finally:
        shutil.rmtree(directory, ignore_errors=True)


def default_placement(plan: Plan, cores: int | None = None) -> Placement:
    """A process per site and train, unless they are too many for the cores: then one is faster."""
    most = MOST_PROCESSES_PER_CORE * (cores or os.cpu_count() or 1)
    return "site" if len({spec.site for spec in plan.nodes}) <= most else "one"


class _Run:
    """One run, from the first process to the report."""

    def __init__(
        self, scenario: Scenario, options: RunOptions, plan: Plan, console: Console
    ) -> None:
        self._scenario, self._options, self._plan = scenario, options, plan
        self._console = console
        placement = options.placement or default_placement(plan)
        self._groups = plan.groups(placement, options.only, options.external)
        # One process is this one: the report then hears every node without leaving it.
        self._here = [spec for specs in self._groups.values() for spec in specs]
        if placement != "one":
            self._here.clear()
        check_kills(options.kills, self._groups, WORLD, one=bool(self._here))
        self._processes = ProcessGroup()
        self._signal = 0
        self._world_failed = False
        self._observer: Any = None
        self._progress: Progress | None = None
        self._bar: TaskID | None = None
        self._stop: Any = None

    def run(self) -> int:
        for specs in self._groups.values():
            for kind in {spec.kind for spec in specs}:
                node_class(kind)
        nodes = sum(len(specs) for specs in self._groups.values())
        plural = "process" if len(self._groups) == 1 else "processes"
        self._console.print(
            f"[bold]{self._plan.scenario}[/bold]: {nodes} nodes in {len(self._groups)} {plural}, "
            f"{self._plan.ticks * self._plan.tick_s:.0f} s to simulate"
        )
        for name in self._options.external:
            self._console.print(f"waiting for {name}, which somebody else runs")
        previous = {
            number: signal.signal(number, self._on_signal)
            for number in (signal.SIGINT, signal.SIGTERM)
        }
        try:
            for name, specs in self._groups.items() if not self._here else ():
                self._processes.start(name, lambda specs=specs: run_nodes(specs))
            self._watch()
        finally:
            self._processes.stop()
            remove_orphaned_segments(besides=os.getpid())  # ROS is shut down here by now
            for number, handler in previous.items():
                signal.signal(number, handler)
        return self._finish(nodes)

    def _on_signal(self, number: int, frame: Any) -> None:
        self._signal = number
        if self._stop is not None and not self._stop.done():
            self._stop.set_result(None)

    def _watch(self) -> None:
        """Observe the run until it ends. ROS is initialised here, after the forks."""
        import rclpy
        from rclpy.experimental.events_executor import EventsExecutor
        from rclpy.signals import SignalHandlerOptions
        from rclpy.task import Future

        from rail_msgs_py.standalone import FOREVER_S

        from .observer import Observer

        context = rclpy.Context()
        rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
        self._stop = Future()
        tracks = tuple(self._scenario.tracks)
        self._observer = Observer(
            self._plan,
            tracks,
            self._on_progress,
            context=context,
            record=self._options.only != "onboard",
        )
        nodes = [self._observer, *make_nodes(self._here, context)]
        executor = EventsExecutor(context=context)
        for node in nodes:
            executor.add_node(node)
        self._arrange_kills(executor, nodes)
        with Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=None),
            TextColumn("{task.completed:.1f} of {task.total:.0f} s  {task.fields[speed]}"),
            TimeRemainingColumn(),
            console=self._console,
            transient=True,
        ) as self._progress:
            total_s = self._plan.ticks * self._plan.tick_s
            self._bar = self._progress.add_task("connecting", total=total_s, speed="")
            if not self._signal:
                executor.spin_until_future_complete(self._stop, timeout_sec=FOREVER_S)
            self._drain(executor)
        executor.shutdown()
        gc.unfreeze()
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown(context=context)

    def _arrange_kills(self, executor: Any, nodes: list[Any]) -> None:
        """Kill equipment in the tick that its time falls into."""
        observer, kills = self._observer, self._options.kills
        if not kills:
            return
        from rail_msgs_py import topics
        from rail_msgs_py.table import figures_from_cdr

        process = {spec.name: name for name, specs in self._groups.items() for spec in specs}
        here = {node.get_fully_qualified_name(): node for node in nodes if node is not observer}

        def kill(name: str) -> None:
            if name not in here:
                self._processes.kill(process[name])
                return
            # Not destroyed before the end: what is under way to it would find no handle.
            executor.remove_node(here[name])
            observer.announce_failure(name, "killed")

        executioner = Executioner(kills, kill)
        shape = len(self._scenario.trains), len(topics.STATE_COLUMNS)
        observer.stream_in(
            topics.STATE, lambda raw: executioner.tick(figures_from_cdr(raw, *shape)[0])
        )

    def _drain(self, executor: Any) -> None:
        """Read what was sent before the end."""
        from rclpy.task import Future

        if self._signal or self._world_failed or self._options.only == "onboard":
            return
        observer = self._observer
        done = Future()

        def poll() -> None:
            waited_s = observer.steady_s() - started_s
            if (observer.complete or waited_s > DRAIN_S) and not done.done():
                done.set_result(None)

        started_s = observer.steady_s()
        if not observer.complete and not observer.failures:
            observer.every(0.01, poll)
            executor.spin_until_future_complete(done, timeout_sec=DRAIN_S + 1.0)

    def _on_progress(self) -> None:
        """Ten times a second: look after the processes and the bar."""
        observer, stop = self._observer, self._stop
        for child in self._processes.poll():
            for spec in self._groups[child.name]:
                observer.announce_failure(spec.name, f"process {child.ended}")
                self._world_failed |= spec.name == WORLD
        if stop.done():
            return
        if observer.finished_ticks is not None or self._world_failed or self._signal:
            stop.set_result(None)
        if self._progress is None or self._bar is None or not observer.tick:
            return
        sim_s = observer.tick * self._plan.tick_s
        elapsed_s = observer.last_tick_s - observer.first_tick_s
        speed = f"{sim_s / elapsed_s:.0f} x real time" if elapsed_s > 0.5 else ""
        self._progress.update(self._bar, description="running", completed=sim_s, speed=speed)

    def _finish(self, nodes: int) -> int:
        interrupted = bool(self._signal) or self._world_failed
        if self._options.only != "onboard":
            report = make_report(
                self._scenario,
                self._plan,
                self._observer,
                nodes=nodes,
                processes=len(self._groups),
                interrupted=interrupted,
            )
            print_report(report, self._console)
            if self._options.report is not None:
                write_report(report, self._options.report)
                self._console.print(f"report written to {self._options.report}")
        if self._world_failed:
            return 1
        return 128 + self._signal if self._signal else 0
