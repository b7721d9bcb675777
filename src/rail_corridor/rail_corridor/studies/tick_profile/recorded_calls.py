"""Calls of arithmetic that the nodes make, recorded with what they are given, and made again."""

from __future__ import annotations

import copy
import gc
import inspect
import sys
import time
from collections import ChainMap
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import CodeType, FrameType
from typing import Any, NamedTuple

from .attribution import stage_of


class Call(NamedTuple):
    """One call, with copies of what it was given before the first call that was recorded."""

    function: Callable[..., Any]
    positional: list[Any]
    keywords: dict[str, Any]


class CallRecorder:
    """Records the calls that lead from other code into arithmetic, in the order of the calls.

    What a recorded call does inside is part of it. Functions that cannot be found by their name, as
    those within others, and calls with what cannot be copied, are not recorded, but what they call
    is.

    Parameters
    ----------
    modules : mapping
        Name of the module by its file.
    within : code, optional
        Of a function: calls outside it are not recorded.
    besides : sequence of str
        Packages whose calls are not recorded. What goes by wall time comes more often in ticks that
        recording makes longer.
    """

    def __init__(
        self,
        modules: Mapping[str, str],
        within: CodeType | None = None,
        besides: Sequence[str] = (),
    ) -> None:
        self._modules, self._within, self._besides = modules, within, tuple(besides)
        self._arithmetic: dict[CodeType, bool] = {}
        self._inside: FrameType | None = None
        self._copies: dict[int, Any] = {}
        self._originals: list[Any] = []
        self.calls: list[Call] = []

    def start(self) -> None:
        """Record from now on what this thread calls."""
        sys.setprofile(self._see)

    def stop(self) -> None:
        """Record no longer."""
        sys.setprofile(None)
        self._inside = None

    def _see(self, frame: FrameType, event: str, _: Any) -> None:
        if self._inside is not None:
            if event == "return" and frame is self._inside:
                self._inside = None
        elif event == "call" and self._is_arithmetic(frame.f_code):
            function = function_of(frame) if self._counts(frame) else None
            call = None if function is None else self._call(function, frame)
            if call is not None:
                self._inside = frame
                self.calls.append(call)

    def _is_arithmetic(self, code: CodeType) -> bool:
        found = self._arithmetic.get(code)
        if found is None:
            module = self._modules.get(code.co_filename, "")
            found = self._arithmetic[code] = stage_of(module) == "arithmetic"
        return found

    def _counts(self, frame: FrameType | None) -> bool:
        while frame is not None:
            if frame.f_code is self._within:
                return True
            if self._modules.get(frame.f_code.co_filename, "").startswith(self._besides):
                return False
            frame = frame.f_back
        return self._within is None

    def _call(self, function: Callable[..., Any], frame: FrameType) -> Call | None:
        arguments = arguments_of(frame)
        # A copy that fails midway must leave nothing behind that a later one finds.
        trial: Any = ChainMap({}, self._copies)
        try:
            positional, keywords = copy.deepcopy(arguments, trial)
        except Exception:
            return None
        # Under the number of the memo itself are the originals, which keep their numbers that way.
        self._originals.append(trial.maps[0].pop(id(trial), None))
        self._copies.update(trial.maps[0])
        return Call(function, positional, keywords)


def arguments_of(frame: FrameType) -> tuple[list[Any], dict[str, Any]]:
    """What a function has just been called with: by position, and by name."""
    found = inspect.getargvalues(frame)
    by_position = frame.f_code.co_argcount
    positional = [found.locals[name] for name in found.args[:by_position]]
    keywords = {name: found.locals[name] for name in found.args[by_position:]}
    if found.varargs is not None:
        positional += found.locals[found.varargs]
    if found.keywords is not None:
        keywords |= found.locals[found.keywords]
    return positional, keywords


def function_of(frame: FrameType) -> Callable[..., Any] | None:
    """The function that a frame runs, None if its name does not lead to it."""
    code = frame.f_code
    if code.co_flags & (inspect.CO_GENERATOR | inspect.CO_COROUTINE | inspect.CO_ASYNC_GENERATOR):
        return None
    for found in _bearers(frame):
        for inner in ("", "fget", "func", "__func__", "__wrapped__", "_implementation"):
            function = getattr(found, inner, None) if inner else found
            if getattr(function, "__code__", None) is code:
                return function
    return None


def _bearers(frame: FrameType) -> Iterator[Any]:
    """Whatever bears the name of the function of a frame."""
    code, name = frame.f_code, frame.f_code.co_name
    if code.co_argcount:
        first = frame.f_locals.get(code.co_varnames[0])
        for owner in (*type(first).__mro__, *(first.__mro__ if isinstance(first, type) else ())):
            if name in vars(owner):
                yield vars(owner)[name]
    yield frame.f_globals.get(name)
    path = getattr(code, "co_qualname", name).split(".")  # from Python 3.11 on
    if len(path) == 2:
        yield vars(frame.f_globals[path[0]]).get(name) if path[0] in frame.f_globals else None


def replay_s(calls: list[Call]) -> float:
    """CPU time that recorded calls take one after the other [s]; they may be replayed again.

    One that fails, because what it works on has been changed by others than the calls recorded,
    counts for as long as it took.
    """
    given = copy.deepcopy([(call.positional, call.keywords) for call in calls])
    prepared = [(call.function, *one) for call, one in zip(calls, given, strict=True)]
    collects = gc.isenabled()
    gc.disable()  # it would look through all of the copies
    begin_s = time.thread_time()
    for function, positional, keywords in prepared:
        try:
            function(*positional, **keywords)
        except Exception:
            continue
    took_s = time.thread_time() - begin_s
    if collects:
        gc.enable()
    return took_s
