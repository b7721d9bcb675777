"""Completion in the shell: scenarios, files, columns; nothing where there is nothing."""

from __future__ import annotations

from pathlib import Path

import pytest

from rail_corridor.cli import completion
from rail_corridor.cli.completion import (
    complete_file,
    complete_recording,
    complete_scenario,
    complete_study,
    complete_topic,
    complete_trace,
)


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("demo.yaml", "run.mcap", "notes.txt", "runs/old.mcap"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.touch()


def test_scenarios_are_the_built_in_ones_and_files() -> None:
    assert complete_scenario("de") == ["dead_station", "demo", "demo.yaml"]
    assert complete_scenario("nothing_of_this") == []
    assert complete_study("ki") == ["kills"]


def test_files_are_of_the_kind_that_is_wanted() -> None:
    assert complete_recording("r") == ["run.mcap", "runs/"]
    assert complete_recording("runs/") == ["runs/old.mcap"]
    assert complete_recording("./ru") == ["./run.mcap", "./runs/"]
    assert complete_file("n") == ["notes.txt"]
    assert complete_file("nowhere/x") == []


def test_topics_are_those_that_begin_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(completion, "_topics", lambda: ["/clock", "/world/state"])
    assert complete_topic("/w") == complete_trace("/w") == ["/world/state"]


def test_a_failure_is_silent(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def fail() -> list[str]:
        raise RuntimeError("no middleware")

    monkeypatch.setattr(completion, "_topics", fail)
    assert complete_topic("/") == []
    assert capfd.readouterr() == ("", "")


def test_behind_a_dot_are_the_columns() -> None:
    assert complete_trace("/train_a/odometer.s") == ["/train_a/odometer.speed_mps"]
    assert complete_trace("/nobody.s") == []
