"""Runs the cases of a study on the workers of dask.distributed, whatever their number.

Cases go out a few more than there are workers at a time, short ones several together; what comes
in is handed on at once. A case that has failed, that hung, or whose worker has died is made once
more; then it counts as failed.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from rail_corridor.errors import InputError

from .cells import Case
from .figures import Figure
from .journal import Entry
from .sources import Source

#: Work of a task that is worth sending [s].
_WORTH_S: Final = 0.5
_MOST_TOGETHER: Final = 500
#: Tasks that are under way for every worker: one is worked on while the next is there.
_AHEAD: Final = 2
_LOOK_S: Final = 0.5


class _Made(NamedTuple):
    """What a worker says of a case; ``wrong`` tells that no other will do better."""

    case: Case
    facts: dict[str, Any]
    figures: dict[str, float | None]
    failure: str | None
    wrong: bool
    wall_s: float


def make_cases(source: Source, figures: Mapping[str, Figure], cases: Sequence[Case]) -> list[_Made]:
    """On a worker: make some runs, one after the other."""
    return [_make(source, figures, case) for case in cases]


def _make(source: Source, figures: Mapping[str, Figure], case: Case) -> _Made:
    begun_s = time.perf_counter()
    try:
        facts, found = source.run(case.values, case.seed, figures)
    except InputError as error:
        return _Made(case, {}, {}, str(error), True, time.perf_counter() - begun_s)
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
        return _Made(case, {}, {}, said, False, time.perf_counter() - begun_s)
    return _Made(case, facts, found, None, False, time.perf_counter() - begun_s)


@dataclass
class _Task:
    cases: tuple[Case, ...]
    sent_s: float = field(default_factory=time.monotonic)


class Engine:
    """Makes cases on a cluster.

    Parameters
    ----------
    client : distributed.Client
    source : Source
    figures : mapping of Figure
    timeout_s : float
        Wall time of one run, after which it counts as hung and its worker is started anew.
    grace_s : float
        Wall time beside that of its runs that a task may take.
    """

    def __init__(
        self,
        client: Any,
        source: Source,
        figures: Mapping[str, Figure],
        timeout_s: float,
        grace_s: float = 30.0,
    ) -> None:
        self._client, self._source, self._figures = client, source, figures
        self._timeout_s, self._grace_s = timeout_s, grace_s
        self._under_way: dict[Any, _Task] = {}
        self._again: deque[Case] = deque()
        self._tried: set[tuple[int, int]] = set()
        self._mean_s = _WORTH_S
        self._moving = False

    @property
    def running(self) -> int:
        """Cases that are under way."""
        return sum(len(task.cases) for task in self._under_way.values())

    def results(self, more: Callable[[int], list[Case]]) -> Iterator[Entry]:
        """Make cases until there are no more.

        Parameters
        ----------
        more : callable
            At most so many further cases, in the order in which they are wanted; none when there
            are no more for now.

        Yields
        ------
        Entry
            Of every case, in the order in which they come in.
        """
        while True:
            self._fill(more)
            if not self._under_way:
                return
            yield from self._come_in()

    def _fill(self, more: Callable[[int], list[Case]]) -> None:
        """Send cases until every worker has enough to do."""
        workers = max(1, len(self._client.scheduler_info(n_workers=-1)["workers"]))
        while len(self._under_way) < _AHEAD * workers:
            if self._again:
                cases = [self._again.popleft()]  # alone: it may take others with it
            else:
                together = int(min(_MOST_TOGETHER, max(1.0, _WORTH_S / self._mean_s)))
                cases = more(together)
            if not cases:
                return
            future = self._client.submit(
                make_cases, self._source, self._figures, tuple(cases), pure=False, retries=0
            )
            self._under_way[future] = _Task(tuple(cases))

    def _come_in(self) -> Iterator[Entry]:
        """What has ended, after a while at the latest."""
        import distributed

        untyped: Any = distributed
        try:
            done = untyped.wait(list(self._under_way), _LOOK_S, "FIRST_COMPLETED").done
        except distributed.TimeoutError:
            done = set()
        for future in done:
            task = self._under_way.pop(future)
            error = None if future.status == "finished" else future.exception()
            if error is not None:
                yield from self._lost(task, f"the worker has died: {type(error).__name__}")
                continue
            for made in future.result():
                self._mean_s += 0.1 * (max(1e-6, made.wall_s) - self._mean_s)
                if made.failure is not None and not made.wrong and self._try_again(made.case):
                    continue
                yield _entry(made)
        yield from self._hung()

    def _hung(self) -> Iterator[Entry]:
        """End tasks that take too long, with their workers."""
        now_s = time.monotonic()
        for future, task in list(self._under_way.items()):
            worked_on = self._client.processing()
            where = [name for name, keys in worked_on.items() if future.key in keys]
            if not where:
                task.sent_s = now_s  # it waits for a worker
                continue
            if now_s - task.sent_s < _AHEAD * (self._timeout_s * len(task.cases) + self._grace_s):
                continue
            del self._under_way[future]
            future.cancel()
            self._client.restart_workers(where, raise_for_error=False)
            yield from self._lost(task, f"did not end within {self._timeout_s:g} s")

    def _lost(self, task: _Task, reason: str) -> Iterator[Entry]:
        for case in task.cases:
            if not self._try_again(case):
                yield _entry(_Made(case, {}, {}, reason, False, 0.0))

    def _try_again(self, case: Case) -> bool:
        """Whether a case gets another try."""
        key = case.cell, case.run
        if key in self._tried:
            return False
        self._tried.add(key)
        self._again.append(case)
        return True


def _entry(made: _Made) -> Entry:
    case = made.case
    return Entry(
        case.cell,
        case.run,
        case.seed,
        dict(case.values),
        made.facts,
        made.figures,
        made.failure,
        made.wall_s,
    )
