"""One corridor to a ROS domain: two would take each other's messages for their own."""

from __future__ import annotations

import fcntl
import itertools
import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from rail_corridor.errors import InputError

_PARTS = ("wayside", "onboard")
_TAKEN = "a corridor is running in this domain already; set another number"
_TURN = itertools.count()


class _TakenError(InputError):
    """The domain is taken."""


#: Domains that are chosen from, where any will do; those beyond them, whose ports no system takes
#: for others, where these are not enough.
_FREE, _MORE = range(10, 40), range(40, 101)
#: The middleware has ports for no more domains.
_MOST = 232


@contextmanager
def free_domain(domain: int | None = None, directory: Path | None = None) -> Iterator[int]:
    """Hold a ROS domain in which no corridor is on this host: a given one, or any.

    What has just left a domain may still be taken for alive there, so that each search begins
    elsewhere.

    Raises
    ------
    InputError
        If the given one, or every one, is taken.
    """
    if domain is not None and not 0 <= domain <= _MOST:
        raise InputError(f"must be from 0 to {_MOST}", field="domain", value=domain)
    start = os.getpid() + next(_TURN) * 7
    turns = range(start, start + len(_FREE))
    some = [*(_FREE[n % len(_FREE)] for n in turns), *_MORE]
    candidates = some if domain is None else [domain]
    for candidate in candidates:
        try:
            with sole_corridor(None, directory, domain=str(candidate)):
                yield candidate
                return
        except _TakenError:
            continue
    raise InputError(_TAKEN, field="domain", value="any" if domain is None else domain)


@contextmanager
def sole_corridor(
    part: str | None = None, directory: Path | None = None, *, domain: str | None = None
) -> Iterator[None]:
    """Hold the ROS domain of this process against other corridors on this host.

    Parameters
    ----------
    part : 'wayside', 'onboard' or 'report', optional
        The one part that runs here; all may run on one host, each once.
    directory : Path, optional
        Where the lock files are; the system's directory for temporary files if not given.
    domain : str, optional
        Another domain than that of the environment.

    Raises
    ------
    InputError
        If a corridor, or the same part of one, is running in the domain already.
    """
    domain = domain or os.environ.get("ROS_DOMAIN_ID") or "0"
    folder = directory or Path(tempfile.gettempdir())
    with ExitStack() as held:
        for name in _PARTS if part is None else (part,):
            path = folder / _lock_name(domain, name)
            lock = held.enter_context(path.open("w"))
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise _TakenError(_TAKEN, field="ROS_DOMAIN_ID", value=_number(domain)) from None
        yield


def is_held(directory: Path | None = None) -> bool:
    """Whether a corridor of this user, or a part of one, holds the ROS domain on this host."""
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    folder = directory or Path(tempfile.gettempdir())
    return any(_is_locked(folder / _lock_name(domain, part)) for part in _PARTS)


def _lock_name(domain: str, part: str) -> str:
    return f"rail_corridor_{os.getuid()}_domain_{domain}_{part}.lock"


def _is_locked(path: Path) -> bool:
    """Whether a file is locked; asks the kernel, as a lock of our own could refuse a corridor."""
    try:
        inode = str(path.stat().st_ino)
        locks = Path("/proc/locks").read_text().splitlines()
    except OSError:
        return False
    # "1: FLOCK  ADVISORY  WRITE 4711 00:2b:1234 0 EOF"
    return any(f":{inode} " in lock and " FLOCK " in lock for lock in locks)


def _number(domain: str) -> int | str:
    return int(domain) if domain.isdecimal() else domain
