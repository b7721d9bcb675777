"""An executable that a test has started: it can be killed and started anew."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
from collections.abc import Iterable, Sequence

from rail_corridor.errors import InputError

_GRACE_S = 3.0


class CommandProcess:
    """One executable in a process group of its own.

    Parameters
    ----------
    command : sequence of str
    domain : int
        ROS domain that it is given.
    """

    def __init__(self, command: Sequence[str], domain: int) -> None:
        self._command = [str(word) for word in command]
        self._environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it.

        Raises
        ------
        InputError
            If there is no such executable.
        """
        try:
            self._process = subprocess.Popen(
                self._command, env=self._environment, start_new_session=True
            )
        except OSError as error:
            reason = f"cannot be started: {error.strerror}"
            raise InputError(reason, field="command", value=self._command[0]) from None

    @property
    def ended(self) -> int | None:
        """Its exit code if it has ended of itself."""
        return None if self._process is None else self._process.poll()

    @property
    def running(self) -> bool:
        """Whether it is alive."""
        return self._process is not None and self._process.poll() is None

    def signal(self, number: int) -> None:
        """Send a signal to it and to what it has started."""
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, number)

    def kill(self) -> None:
        """End it at once, as by a power cut."""
        self.signal(signal.SIGKILL)
        if self._process is not None:
            self._process.wait()
            self._process = None

    def wait(self, within_s: float) -> None:
        """Wait for its end, and enforce it after a wall time."""
        if self._process is None:
            return
        try:
            self._process.wait(timeout=within_s)
        except subprocess.TimeoutExpired:
            self.kill()


def end_all(processes: Iterable[CommandProcess]) -> None:
    """Ask those that are running to end; kill who does not in time."""
    running = [each for each in processes if each.running]
    for each in running:
        each.signal(signal.SIGTERM)
    deadline_s = time.monotonic() + _GRACE_S
    for each in running:
        each.wait(max(0.0, deadline_s - time.monotonic()))
