"""`.ci/browser`: a browser for the tests of the page, or one line that says why there is none."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / ".ci" / "browser"
WORKS = "echo '<p>works</p>'"
SKIPPED = ".ci/browser: no browser, the tests of the page are skipped: "


class Machine:
    """A search path with stand-ins for the programs that are asked for."""

    def __init__(self, directory: Path) -> None:
        self._bin = directory / "bin"
        self._bin.mkdir()
        self._os_release = directory / "os-release"
        self.log = directory / "log"
        for name in ("bash", "sed", "timeout", "chmod", "cat"):
            found = shutil.which(name)
            assert found, name
            (self._bin / name).symlink_to(found)
        self.put("id", "echo 0")
        self.is_distribution("debian")

    def put(self, name: str, body: str) -> None:
        """Put a program there."""
        path = self._bin / name
        path.write_text(f"#!/bin/sh\necho {name} $* >> {self.log}\n{body}\n")
        path.chmod(0o755)

    def put_apt(self, installs: str | None) -> None:
        """Put an apt-get there that installs a chromium of this body, and fails without one."""
        body = "exit 100"
        if installs is not None:
            chromium = self._bin / "chromium"
            body = (
                f'[ "$DEBIAN_FRONTEND" = noninteractive ] || exit 1\n'
                f"cat > {chromium} <<'END'\n#!/bin/sh\n{installs}\nEND\nchmod +x {chromium}"
            )
        self.put("apt-get", body)

    def is_distribution(self, name: str) -> None:
        """Say what the system is."""
        self._os_release.write_text(f"NAME=any\nID={name}\n")

    def run(self) -> str:
        """Run the script, which must not fail; return what it says."""
        done = subprocess.run(
            ["bash", str(SCRIPT)],
            env={"PATH": str(self._bin), "OS_RELEASE": str(self._os_release)},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=60.0,
            check=False,
        )
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.count("\n") <= 1
        return done.stdout.rstrip("\n")


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    """Return a machine of root's, without browser and without apt."""
    return Machine(tmp_path)


def test_one_that_is_there_is_left_alone(machine: Machine) -> None:
    machine.put("chromium-browser", WORKS)
    machine.put_apt(WORKS)
    assert machine.run() == ""
    assert "apt-get" not in machine.log.read_text()


def test_one_is_installed_by_root(machine: Machine) -> None:
    machine.put_apt(WORKS)
    assert machine.run() == ".ci/browser: installed chromium for the tests of the page"


def test_what_only_asks_for_a_snap_is_no_browser(machine: Machine) -> None:
    machine.put("chromium", "echo 'requires the chromium snap to be installed'; exit 10")
    machine.put_apt("exit 10")
    assert machine.run() == f"{SKIPPED}chromium shows no page"


def test_apt_is_not_asked_where_it_would_install_a_snap(machine: Machine) -> None:
    machine.put_apt(WORKS)
    machine.is_distribution("ubuntu")
    assert machine.run() == f"{SKIPPED}the chromium of Ubuntu's apt is a snap"
    assert "apt-get" not in machine.log.read_text()


def test_who_cannot_install_says_why(machine: Machine) -> None:
    assert machine.run() == f"{SKIPPED}there is no apt"
    machine.put_apt(None)
    assert machine.run() == f"{SKIPPED}apt cannot install chromium"
    machine.put("id", "echo 1000")
    assert machine.run() == f"{SKIPPED}apt needs root"
