"""rail view: where it may listen, and what it says when it may not."""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Iterator

import pytest

from rail_corridor.errors import InputError
from rail_corridor.view.address import bind, is_loopback
from rail_corridor.view.command import run_view


@pytest.fixture
def taken() -> Iterator[int]:
    """Return a port that somebody listens on."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        yield other.getsockname()[1]


def test_a_port_in_use_is_one_line(taken: int) -> None:
    with pytest.raises(InputError, match=rf"^--port: {taken}: is in use on 127\.0\.0\.1; give"):
        run_view("127.0.0.1", taken, 40)


@pytest.mark.parametrize(
    ("host", "port", "domain", "line"),
    [
        ("127.0.0.1", 65536, 0, r"^--port: 65536: must be from 1 to 65535"),
        ("127.0.0.1", -1, 0, r"^--port: -1: must be"),
        ("127.0.0.1", 0, 233, r"^--domain: '233': must be from 0 to 232"),
        ("no such host", 0, 0, r"^--host: 'no such host': there is no such host"),
        ("192.0.2.77", 0, 0, r"^--host: '192\.0\.2\.77': is no address of this machine"),
    ],
)
def test_an_address_that_cannot_be_is_one_line(
    host: str, port: int, domain: int, line: str
) -> None:
    with pytest.raises(InputError, match=line):
        run_view(host, port, domain)


def test_a_domain_of_the_environment_is_checked_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "twelve")
    with pytest.raises(InputError, match=r"^ROS_DOMAIN_ID: 'twelve': must be from 0 to 232"):
        run_view("127.0.0.1", 0, None)


def test_the_command_answers_wrong_use_with_exit_code_2(taken: int) -> None:
    command = [sys.executable, "-m", "rail_corridor.cli.main", "view", "--port", str(taken)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"rail: --port: {taken}: is in use")
    assert done.stderr.count("\n") == 1


def test_a_bound_port_is_free_again_afterwards() -> None:
    with bind("127.0.0.1", 0) as first:
        port = first.getsockname()[1]
        assert port > 0
    bind("127.0.0.1", port).close()


@pytest.mark.parametrize(
    ("host", "inside"),
    [("127.0.0.1", True), ("localhost", True), ("::1", True), ("0.0.0.0", False), ("a", False)],
)
def test_only_loopback_is_inside(host: str, inside: bool) -> None:
    assert is_loopback(host) is inside
