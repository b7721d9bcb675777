"""A corridor run inside this process, with nothing but its nodes: for profiles and floors.

``python benchmarks/in_process.py [SCENARIO] [SECONDS] [FILE.json TRAINS]`` prints where the
time of a tick goes, by kind of node; the rest is transport: taking messages and dispatching.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from rail_corridor.loading.loader import load_scenario
from rail_corridor.loading.overrides import Overrides
from rail_corridor.middleware.discovery import discover_on
from rail_corridor.plan.plan import Plan, make_plan
from rail_corridor.run.host import make_node
from rail_corridor.scenario.model import Scenario


def run_in_process(plan: Plan, around: Callable[[Any], None] | None = None) -> tuple[float, float]:
    """Run a plan made with ``observed=False``; wall and CPU time [s] from first to last tick."""
    import rclpy
    from rclpy.experimental.events_executor import EventsExecutor
    from rclpy.signals import SignalHandlerOptions
    from rclpy.task import Future

    from rail_msgs_py.topics.tick import CLOCK, FINISHED

    discover_on("this")
    context = rclpy.Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    nodes = [make_node(spec, context, services=False) for spec in plan.nodes]
    if around is not None:
        for node in nodes:
            around(node)
    done = Future()
    marks: list[tuple[float, float]] = []

    def mark() -> None:
        marks.append((time.perf_counter(), time.process_time()))

    world = nodes[0]
    world.listen(FINISHED, lambda _: (mark(), done.set_result(None)))
    world.create_subscription(CLOCK.type, CLOCK.name(), lambda _: marks or mark(), CLOCK.qos)
    executor = EventsExecutor(context=context)
    for node in nodes:
        executor.add_node(node)
    executor.spin_until_future_complete(done, timeout_sec=3600.0)
    executor.shutdown()
    for node in nodes:
        node.destroy_node()
    rclpy.try_shutdown(context=context)
    (wall0, cpu0), (wall1, cpu1) = marks[0], marks[-1]
    return wall1 - wall0, cpu1 - cpu0


def plan_of(scenario: Scenario) -> Plan:
    """Plan without the report."""
    return make_plan(scenario, Path(tempfile.mkdtemp(prefix="rail_bench_")), observed=False)


def profile(scenario: Scenario) -> None:
    """Print the time in the callbacks of each kind of node, publishing included."""
    from rail_msgs_py.node import CorridorMixin

    spent: Counter[str] = Counter()
    calls: Counter[str] = Counter()

    def timed(self: Any, callback: Callable[..., None]) -> Callable[..., None]:
        kind = type(self).__name__

        def run(*arguments: Any) -> None:
            begin = time.perf_counter()
            callback(*arguments)
            spent[kind] += time.perf_counter() - begin
            calls[kind] += 1

        return run

    CorridorMixin.guarded = timed  # type: ignore[method-assign]
    plan = plan_of(scenario)
    wall_s, cpu_s = run_in_process(plan)
    ticks = scenario.ticks
    per_tick = 1e3 / ticks
    print(f"{scenario.name}: {len(plan.nodes)} nodes, {ticks} ticks")
    for kind, seconds in spent.most_common():
        print(f"  {kind:20} {seconds * per_tick:7.3f} ms a tick, {calls[kind] / ticks:6.1f} calls")
    rest_s = wall_s - sum(spent.values())
    print(f"  {'taking, dispatching':20} {rest_s * per_tick:7.3f} ms a tick")
    print(
        f"  {'whole tick':20} {wall_s * per_tick:7.3f} ms of wall time, {cpu_s * per_tick:.3f} CPU"
    )


if __name__ == "__main__":
    arguments = sys.argv[1:]
    name = arguments[0] if arguments else "demo"
    seconds = float(arguments[1]) if len(arguments) > 1 else 60.0
    track = arguments[2] if len(arguments) > 2 else None
    trains = int(arguments[3]) if len(arguments) > 3 else None
    profile(
        load_scenario(name, overrides=Overrides(duration_s=seconds, track=track, trains=trains))
    )
