"""Runs a corridor: starts its processes, watches them, ends them, makes the report."""

from __future__ import annotations

import gc
import math
import os
import shutil
import signal
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import Progress, TaskID

from rail_corridor.loading.scenario_files import files_of
from rail_corridor.middleware.discovery import discover_on
from rail_corridor.middleware.domain import sole_corridor
from rail_corridor.plan.plan import (
    REPORT,
    WORLD,
    Plan,
    check_external,
    make_plan,
)
from rail_corridor.recording.frames import Attachment
from rail_corridor.recording.run_facts import BEGIN, END, RunEnd, RunStart
from rail_corridor.report.intake import names_read
from rail_corridor.report.report import (
    make_report,
    print_report,
    print_verdict,
    report_text,
    write_report,
)
from rail_corridor.scenario.model import Scenario

from . import exit_codes
from .external_traffic import FULL_NAME as EXTERNAL_TRAFFIC
from .external_traffic import ExternalTrafficRecorder
from .host import destroy_nodes, load_for_nodes, make_context, make_nodes, run_nodes
from .kernels import compile_before_the_first_run
from .kills import FaultInjector, check_kills, unplanned_failures
from .options import RecordOptions, RunOptions, check_recording, default_placement
from .other_half import ELSEWHERE, OtherHalf
from .parameter_services import ParameterServicesOnDemand
from .processes import ProcessGroup, remove_orphaned_segments
from .progress import progress_of
from .recorded_topics import check_recorded_topics

if TYPE_CHECKING:
    from rail_corridor.equipment.node_spec import NodeSpec

    from .run_recording import RunRecording

#: Wall time to read what is still under way when the world has finished.
DRAIN_S = 20.0
#: ... and where some of it will not come, as its sender has failed or the run was stopped.
SETTLE_S = 0.3
#: Wall time for the nodes of this process to leave, after a signal.
LEAVE_S = 0.5


def run(scenario: Scenario, options: RunOptions, console: Console) -> int:
    """Run a scenario to its end, or until interrupted; 0 or one of `exit_codes`."""
    if options.record is not None:
        check_recording(options.record.path, options.only)
    discover_on("all" if options.only else "this")
    directory = Path(tempfile.mkdtemp(prefix="rail_corridor_"))
    try:
        outside = bool(options.record and options.with_external_nodes)
        plan = make_plan(
            scenario,
            directory,
            rate=options.rate,
            timeout_s=options.timeout_s,
            external=options.external,
            attached=options.attached,
            observers=(REPORT, *[EXTERNAL_TRAFFIC] * outside),
        )
        check_external(plan, options.external, options.attached)
        check_recorded_topics(options, plan)
        compile_before_the_first_run(console)
        with sole_corridor(options.only):
            launched = _LaunchedRun(scenario, options, plan, console)
            code = launched.run()
    finally:
        shutil.rmtree(directory, ignore_errors=True)
    if launched.nodes_left:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


class _LaunchedRun:
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
        self._report_reads = names_read(plan)
        self._recording: RunRecording | None = None
        self._recording_failed = False
        self._signal = 0
        self._world_failed = False
        #: Whether some nodes of this process could not be destroyed in time: it must not tidy up.
        self.nodes_left = False
        self._ours = {spec.name for specs in self._groups.values() for spec in specs}
        # Of the wayside the world, without which nothing goes on.
        others = {spec.name for spec in plan.nodes} - self._ours - {*options.external}
        # Nothing begins without the world, which waits for the nodes that it must have itself.
        comes_s = 2.0 * options.timeout_s if WORLD in others else math.inf
        self._other_half = OtherHalf(others & {WORLD} or others, comes_s)
        self._observer: Any = None
        self._progress: Progress | None = None
        self._bar: TaskID | None = None
        self._stop: Any = None

    def run(self) -> int:
        load_for_nodes({spec.kind for specs in self._groups.values() for spec in specs})
        nodes = sum(len(specs) for specs in self._groups.values())
        if self._options.record is not None:
            self._recording = self._record(self._options.record, nodes)
        plural = "process" if len(self._groups) == 1 else "processes"
        here = f"{nodes} nodes in {len(self._groups)} {plural}" if nodes else "the report alone"
        self._console.print(
            f"[bold]{self._plan.scenario}[/bold]: {here}, "
            f"{self._plan.ticks * self._plan.tick_s:.0f} s to simulate"
        )
        for name in (*self._options.external, *self._options.attached):
            self._console.print(f"waiting for {name}, which somebody else runs")
        if self._options.only:
            rest = ELSEWHERE[self._options.only]
            self._console.print(f"waiting for {rest}, which somebody else runs")
        # After the recorder, which would hold the other processes to life.
        self._processes = ProcessGroup()
        previous = {
            number: signal.signal(number, self._on_signal)
            for number in (signal.SIGINT, signal.SIGTERM)
        }
        try:
            for name, specs in self._groups.items() if not self._here else ():
                self._processes.start(name, partial(self._child, name, specs))
            self._watch()
        finally:
            self._processes.stop()
            remove_orphaned_segments(besides=os.getpid())  # ROS is shut down here by now
            try:
                report = self._report(nodes)
            finally:
                self._end_recording()
            for number, handler in previous.items():
                signal.signal(number, handler)
        return self._finish(report)

    def _child(self, name: str, specs: list[NodeSpec]) -> None:
        """In a process of its own: run nodes, and tell the recorder what they publish."""
        tap = self._recording.tap_of(name) if self._recording else None
        run_nodes(specs, tap, switches=self._options.switches, report_reads=self._report_reads)

    def _record(self, options: RecordOptions, nodes: int) -> RunRecording:
        """Start the recorder, before any other process and before ROS."""
        from .run_recording import RunRecording

        plan = self._plan
        processes = len(self._groups)
        run_start = RunStart(plan.scenario, plan.seed, nodes, processes, options.selection)
        return RunRecording(
            options,
            () if self._here else self._groups,
            files_of(self._scenario),
            {BEGIN: run_start.values()},
            external_nodes=self._options.with_external_nodes,
        )

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

        from rail_corridor.report.observer import Observer
        from rail_msgs_py.standalone import FOREVER_S

        tap = self._recording.start() if self._recording else None
        # Of a half without a report, that which reads it is on the other host.
        elsewhere = self._options.only == "onboard"
        context = make_context(tap, self._report_reads if elsewhere else frozenset())
        rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
        self._stop = Future()
        self._observer = Observer(
            self._plan,
            self._on_progress,
            context=context,
            record=self._options.only != "onboard",
            alone=bool(self._here) and not self._options.with_external_nodes,
        )
        here = make_nodes(
            self._here,
            context,
            switches=self._options.switches,
            until=lambda: bool(self._signal),
        )
        nodes = [self._observer, *here]
        if tap is not None and self._options.with_external_nodes:
            others = [spec.name for spec in self._plan.nodes if spec.name not in self._ours]
            others += self._options.attached
            from .run_recording import SHARED

            recorder = ExternalTrafficRecorder(others, tap.select, SHARED, context=context)
            nodes.append(recorder)
            if self._options.only == "report":  # the world elsewhere knows of the report alone
                self._observer.await_connection(lambda: recorder.connected)
        ParameterServicesOnDemand(nodes, (spec.name for spec in self._plan.nodes))
        executor = EventsExecutor(context=context)
        for node in nodes:
            executor.add_node(node)
        self._arrange_kills(executor, nodes)
        if self._options.probe is not None:
            self._options.probe(nodes, context)
        context.delivery.settle(executor)
        with progress_of(self._console) as self._progress:
            total_s = self._plan.ticks * self._plan.tick_s
            self._bar = self._progress.add_task("connecting", total=total_s, speed="")
            if not self._signal:
                executor.spin_until_future_complete(self._stop, timeout_sec=FOREVER_S)
            self._drain(executor)
        executor.shutdown()
        gc.unfreeze()
        # The other half of a corridor must not take what is left here for living nodes.
        in_haste = self._signal and not self._options.only
        self.nodes_left = not destroy_nodes(nodes, LEAVE_S if in_haste else FOREVER_S)
        rclpy.try_shutdown(context=context)

    def _arrange_kills(self, executor: Any, nodes: list[Any]) -> None:
        """Kill equipment in the tick that its time falls into."""
        observer, kills = self._observer, self._options.kills
        if not kills:
            return
        from rail_msgs_py.table import values_from_cdr
        from rail_msgs_py.topics.world import STATE

        process = {spec.name: name for name, specs in self._groups.items() for spec in specs}
        here = {node.get_fully_qualified_name(): node for node in nodes if node is not observer}

        def kill(name: str) -> None:
            if name not in here:
                self._processes.kill(process[name])
                return
            # Not destroyed before the end: what is under way to it would find no handle.
            executor.remove_node(here[name])
            observer.context.delivery.remove(here[name])
            observer.announce_failure(name, "killed")

        injector = FaultInjector(kills, kill)
        shape = len(self._scenario.trains), len(STATE.columns)
        observer.stream_in(STATE, lambda raw: injector.tick(values_from_cdr(raw, *shape)[0]))

    def _drain(self, executor: Any) -> None:
        """Read what was sent before the end; of a run that was stopped, its last whole tick."""
        from rclpy.task import Future

        if self._options.only == "onboard":
            return
        observer = self._observer
        stopped = self._interrupted
        ticks = observer.finished_ticks
        if ticks is None:
            ticks = max(observer.tick - 1, 0)
            observer.recording.end_at(ticks)
        limit_s = SETTLE_S if stopped or observer.failures else DRAIN_S
        done = Future()

        def poll() -> None:
            waited_s = observer.steady_s() - started_s
            if (observer.recording.complete(ticks) or waited_s > limit_s) and not done.done():
                done.set_result(None)

        started_s = observer.steady_s()
        if not observer.recording.complete(ticks):
            observer.every(0.01, poll)
            executor.spin_until_future_complete(done, timeout_sec=limit_s + 1.0)

    def _on_progress(self) -> None:
        """Ten times a second: look after the processes and the bar."""
        observer, stop = self._observer, self._stop
        for child in self._processes.poll():
            for spec in self._groups[child.name]:
                observer.announce_failure(spec.name, f"process {child.ended}")
                self._world_failed |= spec.name == WORLD
        if self._recording is not None and not self._recording_failed:
            self._tell_trouble(self._recording.trouble(), "; the run goes on")
        if stop.done():
            return
        if observer.finished_ticks is None and self._options.only:
            self._look_for_the_other_half()
        if observer.finished_ticks is not None or self._interrupted:
            stop.set_result(None)
        if self._progress is None or self._bar is None or not observer.tick:
            return
        intake = observer.intake
        sim_s = observer.tick * self._plan.tick_s
        elapsed_s = intake.last_tick_s - intake.first_tick_s
        speed = f"{sim_s / elapsed_s:.0f} x real time" if elapsed_s > 0.5 else ""
        self._progress.update(self._bar, description="running", completed=sim_s, speed=speed)

    @property
    def _interrupted(self) -> bool:
        """Whether the run has ended before its time."""
        return bool(self._signal) or self._world_failed or self._other_half.gone

    def _look_for_the_other_half(self) -> None:
        """End with the other half of the corridor."""
        failed = [failure["node"] for failure in self._observer.failures]
        if self._other_half.look(self._observer, failed):
            ended = "has ended" if self._other_half.seen else "has not come"
            line = f"{ELSEWHERE[self._options.only]} {ended}: so this one ends"
            self._console.print(f"[red]{line}[/red]", soft_wrap=True, highlight=False)

    def _tell_trouble(self, trouble: str | None, so: str = "") -> None:
        if trouble is not None and self._recording is not None:
            self._recording_failed = True
            line = f"recording to {self._recording.path} has failed: {trouble}{so}"
            self._console.print(f"[red]{line}[/red]", soft_wrap=True, highlight=False)

    def _report(self, nodes: int) -> dict[str, Any] | None:
        """What the run showed, None where the report is made on another host."""
        if self._options.only == "onboard" or self._observer is None:
            return None
        report = make_report(
            self._scenario,
            self._plan,
            self._observer.intake,
            nodes=nodes,
            processes=len(self._groups),
            interrupted=self._interrupted,
        )
        if self._recording is not None and not self._recording_failed:
            run_end = RunEnd(report["complete"], report["ticks"], report["wall_time_s"])
            file = Attachment("report.json", "application/json", report_text(report).encode())
            self._recording.tell([file], {END: run_end.values()})
        return report

    def _end_recording(self) -> None:
        if self._recording is None:
            return
        trouble = self._recording.finish()
        if not self._recording_failed:
            self._tell_trouble(trouble)

    def _finish(self, report: dict[str, Any] | None) -> int:
        if report is not None:
            if self._options.probe is None:
                print_report(report, self._console)
            if self._options.report is not None:
                write_report(report, self._options.report)
                self._console.print(f"report written to {self._options.report}")
        if self._recording is not None and not self._recording_failed:
            self._console.print(f"recorded to {self._recording.describe()}")
        if self._world_failed or (self._recording_failed and not self._signal):
            return exit_codes.FAILED
        if self._signal:
            return exit_codes.SIGNAL + self._signal
        if self._other_half.gone:
            return exit_codes.HALF_GONE
        failed: list[str] = []
        if self._observer is not None and not self._options.allow_failures:
            groups = () if self._here else self._groups.values()
            failed = unplanned_failures(self._observer.failures, self._options.kills, groups)
        if failed:
            line = f"not meant to fail: {', '.join(failed)} (--allow-failures for exit code 0)"
            self._console.print(f"[red]{line}[/red]", soft_wrap=True, highlight=False)
        if report is not None:
            print_verdict(report, self._console)
            if report["verdict"] == "unsafe":
                return exit_codes.UNSAFE
        return exit_codes.NODES_FAILED if failed else 0
