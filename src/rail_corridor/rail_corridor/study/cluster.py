"""The workers of a study: of this machine, or those of a cluster that there is."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rail_corridor.errors import InputError

_PATIENCE_S = 20.0


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

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    # Runs compute on one core each; numbers of threads are for who calls libraries at will.
    alone = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    with dask.config.set({"distributed.nanny.pre-spawn-environ": alone}):
        if scheduler is not None:
            try:
                client = untyped.Client(scheduler, timeout=_PATIENCE_S)
            except (OSError, ValueError, TimeoutError) as error:
                said = str(error).split(" after ")[0] or type(error).__name__
                raise InputError(said, field="--scheduler", value=scheduler) from None
            with client:
                yield client
            return
        count = workers or len(os.sched_getaffinity(0))
        with (
            untyped.LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                processes=True,
                dashboard_address=None,
                silence_logs=logging.CRITICAL,
                host="127.0.0.1",
            ) as cluster,
            untyped.Client(cluster) as client,
        ):
            yield client
