"""Runs the cases of a study on the workers of dask.distributed, whatever their number.

Every worker has one task at a time, short cases several together; what comes in is handed on at
once. A case that has failed, that hung, or whose worker has died is made once more, alone; then it
counts as failed.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from importlib import metadata
from typing import Any, Final, NamedTuple

from rail_corridor.errors import InputError

from .cells import Case
from .figures import Figure
from .journal import Entry
from .sources import Source
from .version import code_version

#: Work of a task that is worth sending [s].
_WORTH_S: Final = 0.5
_MOST_TOGETHER: Final = 500
_LOOK_S: Final = 0.5
_LOST: Final = "the scheduler has gone: go on with --resume"

More = Callable[[int], list[Case]]


class LostClusterError(RuntimeError):
    """The scheduler has gone."""


class _Made(NamedTuple):
    """What a worker says of a case; ``wrong`` is what no other try will do better."""

    case: Case
    facts: dict[str, Any]
    figures: dict[str, float | None]
    failure: str | None
    wrong: InputError | None
    wall_s: float


def make_cases(
    source: Source, figures: Mapping[str, Figure], cases: Sequence[Case], version: str
) -> list[_Made]:
    """On a worker: make some runs, one after the other.

    Raises
    ------
    InputError
        If the worker has other code: its rows would not be those of the others.
    """
    if code_version() != version:
        reason = (
            f"a worker has another version of the corridor than {version}, which began the study"
        )
        raise InputError(reason, field="version", value=code_version())
    return [_make(source, figures, case) for case in cases]


def _make(source: Source, figures: Mapping[str, Figure], case: Case) -> _Made:
    begun_s = time.perf_counter()

    def failed(said: str, wrong: InputError | None = None) -> _Made:
        return _Made(case, {}, {}, said, wrong, time.perf_counter() - begun_s)

    try:
        facts, found = source.run(case.values, case.seed, figures)
    except InputError as error:
        return failed(str(error), error)
    except Exception as error:
        return failed(f"{type(error).__name__}: {error}")
    return _Made(case, facts, found, None, None, time.perf_counter() - begun_s)


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
    version : str
        Of the code that workers must have.
    grace_s : float
        Wall time beside that of its runs that a task may take.
    """

    def __init__(
        self,
        client: Any,
        source: Source,
        figures: Mapping[str, Figure],
        timeout_s: float,
        version: str,
        grace_s: float = 10.0,
    ) -> None:
        self._client, self._source, self._figures = client, source, figures
        self._timeout_s, self._grace_s, self._version = timeout_s, grace_s, version
        self._under_way: dict[Any, _Task] = {}
        self._again: deque[Case] = deque()
        self._tried: set[tuple[int, int]] = set()
        self._mean_s = _WORTH_S

    @property
    def running(self) -> int:
        """Cases that are under way."""
        return sum(len(task.cases) for task in self._under_way.values())

    def try_out(self, case: Case) -> None:
        """Wait for a worker, and see that it has the corridor and a run has the figures.

        Raises
        ------
        InputError
            If not.
        """
        self._client.wait_for_workers(1)
        try:
            # Nothing of the corridor: what a worker cannot load it would ask for again and again.
            self._client.run(metadata.version, "rail-corridor")
        except metadata.PackageNotFoundError:
            reason = "a worker does not have the package rail-corridor"
            raise InputError(reason, field="--scheduler") from None
        self._client.submit(
            self._source.try_out, case.values, case.seed, self._figures, pure=False
        ).result()

    def results(self, more: More) -> Iterator[Entry]:
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

        Raises
        ------
        InputError
            If there is no such figure, or a worker has other code.
        LostClusterError
            If the scheduler has gone.
        """
        try:
            while True:
                self._fill(more)
                if not self._under_way:
                    return
                yield from self._come_in()
        except (InputError, LostClusterError):
            raise
        except Exception as error:
            # Which error it is depends on the call that has noticed it.
            if isinstance(error, CancelledError | OSError) or self._client.status != "running":
                raise LostClusterError(_LOST) from error
            raise

    def _fill(self, more: More) -> None:
        """Send cases until every worker has something to do."""
        workers = max(1, len(self._client.scheduler_info(n_workers=-1)["workers"]))
        while len(self._under_way) < workers:
            if self._again:
                cases = [self._again.popleft()]  # alone: it may take others with it
            else:
                cases = more(int(min(_MOST_TOGETHER, max(1.0, _WORTH_S / self._mean_s))))
            if not cases:
                return
            self._send(cases)

    def _send(self, cases: Sequence[Case]) -> None:
        future = self._client.submit(
            make_cases,
            self._source,
            self._figures,
            tuple(cases),
            self._version,
            pure=False,
            retries=0,
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
        if self._client.status != "running":
            raise LostClusterError(_LOST)
        for future in done:
            task = self._under_way.pop(future)
            error = None if future.status == "finished" else future.exception()
            if isinstance(error, InputError):
                raise error
            if error is not None:
                yield from self._lost(task, f"the worker has died: {type(error).__name__}")
                continue
            for made in future.result():
                yield from self._made(made)
        yield from self._hung()

    def _made(self, made: _Made) -> Iterator[Entry]:
        self._mean_s += 0.1 * (max(1e-6, made.wall_s) - self._mean_s)
        if made.wrong is not None and made.wrong.field.startswith("figures."):
            raise made.wrong
        if made.failure is None or made.wrong is not None or not self._try_again(made.case):
            yield _entry(made)

    def _hung(self) -> Iterator[Entry]:
        """End tasks that take too long, with their workers."""
        now_s = time.monotonic()
        if not any(
            now_s - task.sent_s > self._patience_s(task) for task in self._under_way.values()
        ):
            return
        worked_on = self._client.processing()
        for future, task in list(self._under_way.items()):
            where = [name for name, keys in worked_on.items() if future.key in keys]
            if not where:
                task.sent_s = now_s  # it waits for a worker
            elif now_s - task.sent_s > self._patience_s(task):
                del self._under_way[future]
                future.cancel()
                self._client.restart_workers(where, raise_for_error=False)
                yield from self._lost(task, f"did not end within {self._timeout_s:g} s")

    def _patience_s(self, task: _Task) -> float:
        return self._timeout_s * len(task.cases) + self._grace_s

    def _lost(self, task: _Task, reason: str) -> Iterator[Entry]:
        for case in task.cases:
            if not self._try_again(case):
                yield _entry(_Made(case, {}, {}, reason, None, 0.0))

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
