"""Samples what the main thread is at, by a timer of the system.

A sample is the functions under way, taken where the interpreter looks for signals: after a call of
compiled code in whoever called it, and as a function begins. Between samples nothing is done, so
that a tick takes no longer and calls weigh no more than they do; a profiler that is told of every
call makes a tick half as long again. A sample weighs the CPU time since the one before it: what
others on the machine take is nobody's.
"""

from __future__ import annotations

import dis
import signal
import time
from collections import defaultdict
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, Final, NamedTuple

from rail_msgs_py.delivery import LocalDelivery

#: Between two samples [s].
INTERVAL_S: Final = 0.001

#: Calls the callbacks of nodes.
HANDS_OVER: Final = LocalDelivery.run.__code__
_OF_THE_PROFILE: Final = Path(__file__).parent
_RESUME: Final = dis.opmap.get("RESUME")  # from Python 3.11 on


class Stack(NamedTuple):
    """What is under way."""

    #: Functions, the root first.
    functions: tuple[CodeType, ...]
    #: Module of the node that is being handed a message; empty if none is.
    reader: str = ""


class _Sample(NamedTuple):
    """What was under way, the innermost function first."""

    functions: list[CodeType]
    #: Where the innermost function is.
    instruction: int
    reader: Any
    seconds: float


class Sampler:
    """Samples of the main thread, which also starts and stops it."""

    def __init__(self) -> None:
        self.samples = 0
        self._samples: list[_Sample] = []
        # The hash of a function's code is that of all its instructions: here it goes by identity.
        self._cpu_s: dict[tuple[int | str, ...], float] = defaultdict(float)
        self._stacks: dict[tuple[int | str, ...], Stack] = {}
        self._begins: dict[int, int] = {}
        self._last_s = 0.0
        self._under_way = False
        #: Whether a sample is being taken, which may last until the next one is due.
        self._sampling = False

    def start(self) -> None:
        """Sample from now on."""
        self._before = signal.signal(signal.SIGALRM, self._sample)
        signal.siginterrupt(signal.SIGALRM, False)  # threads of the middleware wait on
        self._under_way = True
        self._last_s = time.thread_time()
        signal.setitimer(signal.ITIMER_REAL, INTERVAL_S, INTERVAL_S)

    def stop(self) -> None:
        """Sample no longer; does no harm if it was not started."""
        if not self._under_way:
            return
        self._under_way = False
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, self._before)
        self.samples += len(self._samples)
        for sample in self._samples:
            self._add(sample)
        self._samples.clear()

    def cpu_s(self) -> list[tuple[Stack, float]]:
        """Every stack that was met, and how long [s]."""
        return [(self._stacks[key], seconds) for key, seconds in self._cpu_s.items()]

    def _sample(self, _: int, frame: FrameType | None) -> None:
        if not self._under_way or self._sampling:
            return
        self._sampling = True  # first: the system call is where the next signal is met
        now_s = time.thread_time()
        functions: list[CodeType] = []
        instruction, reader = -1 if frame is None else frame.f_lasti, None
        while frame is not None:
            if frame.f_code is HANDS_OVER:
                reader = frame.f_locals.get("reader")
            functions.append(frame.f_code)
            frame = frame.f_back
        self._samples.append(_Sample(functions, instruction, reader, now_s - self._last_s))
        self._last_s = time.thread_time()
        self._sampling = False

    def _add(self, sample: _Sample) -> None:
        functions = sample.functions
        if len(functions) > 1 and sample.instruction <= self._begin(functions[0]):
            functions = functions[1:]  # a function that just begins has done nothing yet
        if Path(functions[0].co_filename).parent == _OF_THE_PROFILE:
            return  # what starts and stops the samples belongs to no tick
        reader = "" if sample.reader is None else type(sample.reader.node).__module__
        key: tuple[int | str, ...] = (reader, *map(id, functions))
        self._cpu_s[key] += sample.seconds
        self._stacks.setdefault(key, Stack(tuple(reversed(functions)), reader))

    def _begin(self, code: CodeType) -> int:
        """Where a function begins: its first instruction of its own, in bytes."""
        begin = self._begins.get(id(code))
        if begin is None:
            instructions = code.co_code[::2]
            begin = -1 if _RESUME is None else 2 * instructions.find(_RESUME)
            self._begins[id(code)] = begin
        return begin
