"""The stacks of a profile as a file to look at."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from pyinstrument.renderers import HTMLRenderer, SpeedscopeRenderer
from pyinstrument.session import Session

from .attribution import Attribution
from .sampler import INTERVAL_S, Stack


def _frame(name: str, file: str = "<corridor>", line: int = 0) -> str:
    """One level of a stack, as pyinstrument writes it."""
    return f"{name}\x00{file}\x00{line}"


_ROOT = _frame("tick")


def write_flame_graph(
    stacks: Sequence[tuple[Stack, float]],
    attribute: Callable[[Stack], Attribution],
    title: str,
    path: Path,
) -> None:
    """Write a flame graph: a page, or for a name in ``.json`` a file for speedscope.

    Each stack begins with the kind of node, and goes on with its callback.

    Parameters
    ----------
    stacks : sequence of stack and time [s]
    attribute : callable
        Whose a stack is.
    title : str
    path : Path
    """
    records: list[tuple[list[str], float]] = []
    for stack, seconds in stacks:
        whose = attribute(stack)
        of_callback = stack.functions[whose.begin :] if whose.begin >= 0 else stack.functions[-1:]
        frames = [
            _frame(
                getattr(code, "co_qualname", code.co_name), code.co_filename, code.co_firstlineno
            )
            for code in of_callback
        ]
        records.append(([_ROOT, _frame(whose.kind), *frames], seconds))
    records.sort()  # equal frames side by side: along the time axis they are one
    session = Session(
        frame_records=records,
        start_time=time.time(),
        duration=sum(seconds for _, seconds in stacks),
        min_interval=INTERVAL_S,
        max_interval=INTERVAL_S,
        sample_count=len(records),
        start_call_stack=[_ROOT],
        target_description=title,
        cpu_time=0.0,
        sys_path=sys.path,
        sys_prefixes=Session.current_sys_prefixes(),
    )
    speedscope = path.suffix == ".json"
    renderer = SpeedscopeRenderer() if speedscope else HTMLRenderer()
    path.write_text(renderer.render(session), encoding="utf-8")
