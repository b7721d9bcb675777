"""Measures the ticks of a run in one process, from within it."""

from __future__ import annotations

import gc
import statistics
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from typing import Any, Final

from rail_corridor.equipment.registry import WORLD, node_kinds, subsystems
from rail_msgs_py.delivery import LocalDelivery, LocalReader
from rail_msgs_py.topics.tick import CLOCK

from .attribution import Attribution, Attributor, kind_of, modules_by_file
from .recorded_calls import CallRecorder, replay_s
from .recorded_messages import MessageRecorder
from .sampler import Sampler, Stack
from .schedule import Phase, Schedule
from .transport_floor import MiddlewareLoop, hand_over_s

#: Packages that the callbacks of the report begin in.
_REPORT: Final = ("rail_corridor.report", "rail_corridor.run_data")
#: Calls the callbacks of nodes.
_HANDS_OVER: Final = LocalDelivery.run.__code__
_ROUNDS: Final = 5
#: Wall time after which no further round begins.
_ENOUGH_S: Final = 2.0


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
        self._messages: list[MessageRecorder] = []
        self._calls: list[CallRecorder] = []
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
        reader = LocalReader(self, _raise, self._on_clock)
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
            self._messages.append(MessageRecorder(self._context.delivery, self._nodes))
            self._messages[-1].start()
            self._calls.append(CallRecorder(self._modules, _HANDS_OVER, besides=_REPORT))
            self._calls[-1].start()
        elif phase == "sampled":
            self.sampler.start()

    def _end(self, phase: Phase) -> None:
        if phase == "recorded":
            self._calls[-1].stop()
            self._messages[-1].stop()
            gc.collect()
            gc.freeze()  # what has been recorded stays: no need to look through it in every tick
        elif phase == "sampled":
            self.sampler.stop()

    def finish(self) -> None:
        """End what is under way, after a run that has ended at any time."""
        if self._phase == "recorded":  # a stretch that is not whole
            self._calls.pop().stop()
            self._messages.pop().stop()
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
        return self._of_a_tick(
            lambda: sum(
                hand_over_s(tick.local, stretch.readers)
                for stretch in self._messages
                for tick in stretch.ticks
            )
        )

    def middleware_floor_s(self) -> float:
        """CPU time to carry those messages of a tick that the middleware is given."""
        topics = {name: what for one in self._messages for name, what in one.carried.items()}
        with MiddlewareLoop(topics) as loop:
            return self._of_a_tick(
                lambda: sum(
                    loop.carry_s(tick.carried)
                    for stretch in self._messages
                    for tick in stretch.ticks
                )
            )

    def arithmetic_floor_s(self) -> float:
        """CPU time of the arithmetic of a tick, one call after the other."""
        return self._of_a_tick(lambda: sum(replay_s(one.calls) for one in self._calls))

    def _of_a_tick(self, measure_s: Callable[[], float]) -> float:
        measure_s()  # kernels may be compiled for other arrays than those of the run
        begin_s, rounds = time.perf_counter(), [measure_s()]
        while len(rounds) < _ROUNDS and time.perf_counter() - begin_s < _ENOUGH_S:
            rounds.append(measure_s())
        return statistics.median(rounds) / self.ticks["recorded"]


def _raise(error: Exception) -> None:
    raise error


def kinds_by_module() -> dict[str, str]:
    """Kind of every node by the module of its class, and the report's packages."""
    owners = {kind.name: f"{one.name}: " for one in subsystems() for kind in one.nodes}
    kinds = {
        kind.target.partition(":")[0]: f"{owners.get(kind.name, '')}{kind.name}"
        for kind in (WORLD, *node_kinds().values())
    }
    return kinds | dict.fromkeys(_REPORT, "report")
