"""corridor.py: what it takes for a finished environment, and what it says when it cannot go on."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def script(tmp_path: Path) -> ModuleType:
    """Return corridor.py as a module that lives in a checkout of its own, in a path with spaces."""
    home = tmp_path / "a checkout"
    home.mkdir()
    for name in ("corridor.py", "requirements.lock", "pyproject.toml"):
        shutil.copy(ROOT / name, home / name)
    spec = importlib.util.spec_from_file_location("corridor_under_test", home / "corridor.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def steps(script: ModuleType, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Replace the slow work of the set-up by a list of the steps taken."""
    taken: list[str] = []

    def make() -> None:
        taken.append("make")
        shutil.rmtree(script.VENV, ignore_errors=True)
        script.VENV.mkdir()

    monkeypatch.setattr(script, "make_environment", make)
    monkeypatch.setattr(script, "run_pip", lambda arguments: taken.append("project"))
    monkeypatch.setattr(script, "compile_what_runs", lambda: None)
    return taken


def test_first_use_makes_everything_and_the_second_nothing(
    script: ModuleType, steps: list[str]
) -> None:
    script.set_up()
    assert steps == ["make", "project"]
    script.set_up()
    assert steps == ["make", "project"]


def test_a_changed_lock_file_makes_it_anew(script: ModuleType, steps: list[str]) -> None:
    script.set_up()
    steps.clear()
    with script.LOCK_FILE.open("a") as lock:
        lock.write("# changed\n")
    script.set_up()
    assert steps == ["make", "project"]


def test_a_changed_project_file_installs_the_project_only(
    script: ModuleType, steps: list[str]
) -> None:
    script.set_up()
    steps.clear()
    with (script.ROOT / "pyproject.toml").open("a") as project:
        project.write("# changed\n")
    script.set_up()
    assert steps == ["project"]


@pytest.mark.parametrize("key", ["python", "root", "base", "layout"])
def test_another_interpreter_or_place_makes_it_anew(
    script: ModuleType, steps: list[str], key: str
) -> None:
    script.set_up()
    steps.clear()
    script.write_stamp({**script.wanted_stamp(), key: "something else"})
    script.set_up()
    assert steps == ["make", "project"]


@pytest.mark.parametrize("stamp", [None, b"", b"\xff\xfe\x00", b"no equals sign", b"lock=1"])
def test_a_half_made_environment_is_recognised(
    script: ModuleType, steps: list[str], stamp: bytes | None
) -> None:
    script.VENV.mkdir()
    if stamp is not None:
        script.STAMP.write_bytes(stamp)
    script.set_up()
    assert steps == ["make", "project"]


def test_an_interruption_leaves_no_stamp(
    script: ModuleType,
    steps: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def interrupted(arguments: list[str]) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(script, "run_pip", interrupted)
        assert script.main([]) == 130
    assert not script.STAMP.exists()
    assert "interrupted" in capsys.readouterr().err
    script.set_up()
    assert steps == ["make", "make", "project"]
    assert script.read_stamp() == script.wanted_stamp()


def test_a_missing_venv_module_is_one_line(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(script.importlib.util, "find_spec", lambda name: None)
    assert script.main([]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "python3-venv" in message
    assert not script.VENV.exists()


def test_a_failing_pip_shows_its_last_lines(script: ModuleType) -> None:
    bin_dir = script.VENV / "bin"
    bin_dir.mkdir(parents=True)
    fake = bin_dir / "python"
    fake.write_text("#!/bin/sh\necho Collecting numpy\necho no route to anywhere\nexit 1\n")
    fake.chmod(0o755)
    with pytest.raises(script.SetupError, match="pip failed"):
        script.run_pip(["-r", "requirements.lock"])


def test_a_sourced_ros_installation_does_not_leak_in(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", "/opt/ros/jazzy/lib/python3.12/site-packages")
    monkeypatch.setenv("AMENT_PREFIX_PATH", "/opt/ros/jazzy")
    monkeypatch.setenv("LD_LIBRARY_PATH", "/opt/ros/jazzy/lib:/usr/local/lib:/opt/ros/jazzy2")
    env = script.clean_environment()
    assert "PYTHONPATH" not in env
    assert "AMENT_PREFIX_PATH" not in env
    assert env["LD_LIBRARY_PATH"] == "/usr/local/lib:/opt/ros/jazzy2"


def test_the_demo_is_what_runs_without_arguments(
    script: ModuleType, steps: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[list[str]] = []
    monkeypatch.setattr(os, "execve", lambda path, argv, env: calls.append(argv[1:]))
    script.main([])
    script.main(["check", "plain_line"])
    assert calls == [["run", "demo"], ["check", "plain_line"]]


def test_an_unsupported_python_gets_one_line(tmp_path: Path) -> None:
    # The version test reads sys.version_info, so the newest Python can play an old one.
    source = (ROOT / "corridor.py").read_text(encoding="utf-8")
    pretend = "import sys; sys.version_info = (3, 8, 18, 'final', 0)\n"
    run = subprocess.run(
        [sys.executable, "-I", "-c", pretend + source], capture_output=True, text=True, check=False
    )
    assert run.returncode == 2
    assert run.stderr.startswith("corridor.py: needs Python 3.10 to 3.13, this is 3.8")
    assert run.stderr.count("\n") == 1
