"""One corridor to a ROS domain: two would take each other's messages for their own."""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from rail_corridor.errors import InputError

_PARTS = ("wayside", "onboard")


@contextmanager
def sole_corridor(part: str | None = None, directory: Path | None = None) -> Iterator[None]:
    """Hold the ROS domain of this process against other corridors on this host.

    Parameters
    ----------
    part : 'wayside', 'onboard' or 'report', optional
        The one part that runs here; all may run on one host, each once.
    directory : Path, optional
        Where the lock files are; the system's directory for temporary files if not given.

    Raises
    ------
    InputError
        If a corridor, or the same part of one, is running in the domain already.
    """
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    folder = directory or Path(tempfile.gettempdir())
    with ExitStack() as held:
        for name in _PARTS if part is None else (part,):
            path = folder / f"rail_corridor_{os.getuid()}_domain_{domain}_{name}.lock"
            lock = held.enter_context(path.open("w"))
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                reason = "a corridor is running in this domain already; set another number"
                raise InputError(reason, field="ROS_DOMAIN_ID", value=_number(domain)) from None
        yield


def _number(domain: str) -> int | str:
    return int(domain) if domain.isdecimal() else domain
