"""Measures the ticks of a run in one process, from within it."""

from __future__ import annotations

import gc
import statistics
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from typing import Any, Final

from rail_corridor.equipment.registry import WORLD, node_kinds, subsystems
from rail_msgs_py.delivery import LocalReader
from rail_msgs_py.topics.tick import CLOCK

from .attribution import Attribution, Attributor, kind_of, modules_by_file
from .recorded_calls import CallRecorder, replay_s
from .recorded_messages import Carried, MessageRecorder, fail_aloud
from .sampler import HANDS_OVER, Sampler, Stack
from .schedule import Phase, Schedule
from .transport_floor import MiddlewareLoop, hand_over_s

#: Packages that the callbacks of the report begin in.
_REPORT: Final = ("rail_corridor.report", "rail_corridor.run_data")
_ROUNDS: Final = 3


class TickProbe:
    """Samples a run tick by tick, and records some of its ticks for the floors.

    Parameters
    ----------
    schedule : Schedule
    """

    def __init__(self, schedule: Schedule) -> None:
        self._schedule = schedule
        self._tick = -1
        self._phase: Phase = "warm-up"
        self._begin_tick, self._begin_cpu_s, self._begin_s = 0, 0.0, 0.0
        #: CPU time of the thread, wall time, and number of the ticks of each phase.
        self._cpu_s: dict[Phase, float] = defaultdict(float)
        self._wall_s: dict[Phase, float] = defaultdict(float)
        self.ticks: Counter[Phase] = Counter()
        self.sampler = Sampler()
        self._hand_over_s = self._arithmetic_s = 0.0
        #: What the middleware carries, and what it was given tick by tick.
        self._carried: dict[str, Carried] = {}
        self._given: list[list[tuple[str, bytes]]] = []
        #: Nodes of each kind.
        self.nodes: Counter[str] = Counter()

    def attach(self, nodes: list[Any], context: Any) -> None:
        """Begin with the first tick of nodes that share a context and its delivery."""
        kinds, modules = kinds_by_module(), modules_by_file()
        for node in nodes:
            module = type(node).__module__
            self.nodes[kind_of(module, kinds) or kinds.setdefault(module, module)] += 1
        self._attributor = Attributor(kinds, modules)
        self._modules, self._context, self._nodes = modules, context, nodes
        reader = LocalReader(self, fail_aloud, self._on_clock)
        context.delivery.read(CLOCK.name(), reader, lambda: None)

    def _on_clock(self, _: Any) -> None:
        now_s, cpu_s = time.perf_counter(), time.thread_time()
        self._tick += 1
        phase = self._schedule.phase(self._tick)
        if phase == self._phase and self._tick > 0:
            return
        if self._tick:
            self._wall_s[self._phase] += now_s - self._begin_s
            self._cpu_s[self._phase] += cpu_s - self._begin_cpu_s
        self.ticks[self._phase] += self._tick - self._begin_tick
        self._end(self._phase)
        self._phase = phase
        self._begin(phase)
        self._begin_tick = self._tick
        self._begin_s, self._begin_cpu_s = time.perf_counter(), time.thread_time()

    def _begin(self, phase: Phase) -> None:
        if phase == "recorded":
            self._messages = MessageRecorder(self._context.delivery, self._nodes)
            self._messages.start()
            self._calls = CallRecorder(self._modules, HANDS_OVER, besides=_REPORT)
            self._calls.start()
        elif phase == "sampled":
            self.sampler.start()

    def _end(self, phase: Phase) -> None:
        if phase == "recorded":
            self._calls.stop()
            self._messages.stop()
            self._measure_floors()
            gc.collect()
            gc.freeze()  # what has been recorded stays: no need to look through it in every tick
        elif phase == "sampled":
            self.sampler.stop()

    def _measure_floors(self) -> None:
        """Do again what was recorded, here and now: the machine's speed drifts in the run."""
        calls, messages = self._calls.calls, self._messages
        self._arithmetic_s += _typical_s(lambda: replay_s(calls))
        self._hand_over_s += _typical_s(
            lambda: sum(hand_over_s(tick.local, messages.readers) for tick in messages.ticks)
        )
        self._carried |= messages.carried
        self._given += [tick.carried for tick in messages.ticks]

    def finish(self) -> None:
        """End what is under way, after a run that has ended at any time."""
        if self._phase == "recorded":  # a stretch that is not whole
            self._calls.stop()
            self._messages.stop()
        self.sampler.stop()

    @property
    def complete(self) -> bool:
        """Whether the run came to the end of a stretch of samples."""
        return self.ticks["sampled"] > 0

    def attribute(self, stack: Stack) -> Attribution:
        """Whose a sample is."""
        files = [code.co_filename for code in stack.functions]
        return self._attributor.attribute(files, stack.reader)

    def tick_s(self, phase: Phase) -> float:
        """CPU time of a tick of a phase."""
        return self._cpu_s[phase] / self.ticks[phase]

    def wall_tick_s(self, phase: Phase) -> float:
        """Wall time of a tick of a phase, with what others on the machine take."""
        return self._wall_s[phase] / self.ticks[phase]

    def hand_over_floor_s(self) -> float:
        """CPU time to hand over the messages of a tick, past the middleware, to idle readers."""
        return self._hand_over_s / self.ticks["recorded"]

    def middleware_floor_s(self) -> float:
        """CPU time to carry those messages of a tick that the middleware is given.

        It is measured here, with nodes of its own.
        """
        with MiddlewareLoop(self._carried) as loop:
            carried_s = _typical_s(lambda: sum(map(loop.carry_s, self._given)))
        return carried_s / self.ticks["recorded"]

    def arithmetic_floor_s(self) -> float:
        """CPU time of the arithmetic of a tick, one call after the other."""
        return self._arithmetic_s / self.ticks["recorded"]


def _typical_s(measure_s: Callable[[], float]) -> float:
    measure_s()  # kernels may be compiled for other arrays than those of the run
    return statistics.median(measure_s() for _ in range(_ROUNDS))


def kinds_by_module() -> dict[str, str]:
    """Kind of every node by the module of its class, and the report's packages."""
    owners = {kind.name: f"{one.name}: " for one in subsystems() for kind in one.nodes}
    kinds = {
        kind.target.partition(":")[0]: f"{owners.get(kind.name, '')}{kind.name}"
        for kind in (WORLD, *node_kinds().values())
    }
    return kinds | dict.fromkeys(_REPORT, "report")
