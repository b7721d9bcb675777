"""The workers of a study: of this machine, or those of a cluster that there is."""

from __future__ import annotations

import logging
import os
import signal
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from rail_corridor.errors import InputError

from .corridor_run import SCRATCH

_PATIENCE_S: Final = 20.0
_HEEDLESS: Final = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
_ALONE: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@contextmanager
def client_of(scheduler: str | None, workers: int | None) -> Iterator[Any]:
    """Connect to a scheduler, or start workers here; they end with the block.

    Parameters
    ----------
    scheduler : str, optional
        Address of a scheduler of dask.distributed, as ``tcp://host:8786``.
    workers : int, optional
        Of this machine; as many as it has cores if not given.

    Raises
    ------
    InputError
        If nobody answers there.
    """
    import dask
    import distributed

    untyped: Any = distributed

    for name in ("distributed", "tornado", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if scheduler is not None:
        try:
            client = untyped.Client(scheduler, timeout=_PATIENCE_S)
        except (OSError, ValueError, TimeoutError) as error:
            said = str(error).split(" after ")[0] or type(error).__name__
            raise InputError(said, field="--scheduler", value=scheduler) from None
        with client:
            yield client
        return
    with tempfile.TemporaryDirectory(prefix="rail_study_") as scratch:
        settings = {
            # Runs compute on one core each; numbers of threads are for who calls libraries at
            # will. What workers leave behind that are killed goes with the folder.
            "distributed.nanny.pre-spawn-environ": dict.fromkeys(_ALONE, "1"),
            "temporary-directory": scratch,
            # Ctrl-C is said to the whole group: workers are ended by who has started them.
            "distributed.worker.preload": [_HEEDLESS],
            # By default workers are looked at a hundred times a second, at the cost of the runs.
            "distributed.worker.profile.enabled": False,
            "distributed.worker.memory.monitor-interval": "1s",
            "distributed.admin.tick.interval": "2s",
            "distributed.admin.tick.limit": "1h",
            "distributed.admin.system-monitor.interval": "5s",
            # Who makes a run once more is the engine.
            "distributed.scheduler.allowed-failures": 0,
        }
        with dask.config.set(settings):
            with _signals_wait():
                cluster = untyped.LocalCluster(
                    n_workers=workers or len(os.sched_getaffinity(0)),
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address=":0",
                    silence_logs=logging.CRITICAL,
                    host="127.0.0.1",
                    env={SCRATCH: scratch},
                )
            with cluster, untyped.Client(cluster) as client:
                yield client


@contextmanager
def _signals_wait() -> Iterator[None]:
    """Let signals to end wait until the block has ended: half a cluster cannot be taken down."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    come: list[int] = []
    before = {
        number: signal.signal(number, lambda which, _: come.append(which))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if come:  # also instead of what a worker said that the signal came to as well
            signal.raise_signal(come[0])
