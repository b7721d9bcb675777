"""Rules for the whole test suite."""

from __future__ import annotations

import fcntl
import itertools
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

# Threads of small matrix products only stand in each other's way; as in `rail` itself.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Examples are drawn from a fixed seed: a test run says the same thing every time.
settings.register_profile("corridor", derandomize=True, deadline=None, print_blob=True)
settings.load_profile("corridor")

# Tests never talk to a corridor that runs on this or another machine.
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

# Nodes inside of pytest do without shared memory: waiting on a port that a killed process has left
# locked never ends (Fast DDS issue 6485). Processes that tests start use it, as for a user.
os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")

#: Domains that tests share; one at a time has each.
_DOMAINS = range(40, 100)
#: The next one for each test: of what has just ended the middleware may still think it alive.
_TURN = itertools.count()


@contextmanager
def _free_domain() -> Iterator[int]:
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    turn = next(_TURN)
    for step in range(len(_DOMAINS)):
        domain = _DOMAINS[(worker * 30 + turn + step) % len(_DOMAINS)]
        path = Path(tempfile.gettempdir()) / f"rail_corridor_test_domain_{domain}.lock"
        with path.open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            yield domain
            return
    raise RuntimeError("every domain is taken")


@pytest.fixture
def ros_domain() -> Iterator[int]:
    """Return a ROS domain that no other test on this machine is in."""
    with _free_domain() as domain:
        yield domain


@pytest.fixture(scope="module")
def module_domain() -> Iterator[int]:
    """Return a ROS domain that no other module of tests on this machine is in."""
    with _free_domain() as domain:
        yield domain


_SECOND_GROUP = {
    *("test_corridor", "test_plugin", "test_axle_counter", "test_two_hosts", "test_examples"),
    *("test_placement", "test_failures", "test_losslessness", "test_listeners", "test_recordings"),
}
_THIRD_GROUP = {"test_positions_on_board", "test_train_radio", "test_study", "test_wrong"}


def pytest_itemcollected(item: pytest.Item) -> None:
    """Put system tests into groups, one after the other within each: they start processes.

    Those that look at the wall clock are in the first; the others wait for what a run does.
    """
    if item.get_closest_marker("system"):
        group = "system"
        if item.path.stem in _SECOND_GROUP:
            group = "system_runs"
        elif item.path.stem in _THIRD_GROUP:
            group = "system_safety"
        item.add_marker(pytest.mark.xdist_group(group))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the long groups; the short tests fill what time they leave."""
    items.sort(key=lambda item: item.get_closest_marker("system") is None)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object) -> None:
    """Say how a worker of pytest-xdist ended that was not to end: by which signal or code."""
    if error is None:
        return
    process = node.gateway._io.popen
    with suppress(subprocess.TimeoutExpired):
        process.wait(timeout=5.0)
    print(f"\n{node.gateway.id} ended with {process.returncode}", file=sys.stderr)
