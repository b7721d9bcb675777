"""The report: stable keys, JSON that any reader takes, and a table of the same."""

from __future__ import annotations

import io
import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import make_plan, run_data_of
from rail_corridor.report.report import make_report, print_report, write_report
from rail_msgs_py.topics.ranging import LINKS, POSITION, VRS_CHANNEL
from rail_msgs_py.topics.world import STATE

KEYS = {
    *("scenario", "seed", "ticks", "sim_time_s", "wall_time_s", "real_time_factor", "nodes"),
    *("processes", "complete", "digest", "failures", "events", "trains", "missing_ticks"),
    *("verdict", "reasons", "event_counts"),
}


def report_of(directory: Path, ticks: int, **more: Any) -> dict[str, Any]:
    """Return the report of a run in which nothing moved and nothing was heard."""
    scenario = load_scenario("plain_line")
    recording = run_data_of(scenario)
    for tick in range(ticks):
        state = np.zeros((1, len(STATE.columns)))
        state[0, STATE.columns.index("on_line")] = 1.0
        recording[STATE].put(tick, slice(None), state)
        recording[LINKS].put(tick, slice(None), np.zeros((1, len(LINKS.columns))))
        recording[VRS_CHANNEL].put(tick, 0, np.array([0.0, 0.0, -math.inf, -math.inf]))
        recording[POSITION].put(tick, 0, np.array([0.0, 0.0, math.inf, 0.0]))
    observer: Any = SimpleNamespace(
        recording=recording,
        first_tick_s=10.0 if ticks else math.nan,
        last_tick_s=12.0 if ticks else math.nan,
        failures=more.get("failures", []),
        events=more.get("events", []),
    )
    plan = make_plan(scenario, directory)
    return make_report(scenario, plan, observer, nodes=10, processes=3, interrupted=False)


def shown(report: dict[str, Any]) -> str:
    console = Console(width=120, record=True, file=io.StringIO())
    print_report(report, console)
    return console.export_text()


def test_keys_and_figures(tmp_path: Path) -> None:
    report = report_of(tmp_path, 40)
    assert set(report) == KEYS
    assert (report["scenario"], report["seed"], report["ticks"]) == ("plain_line", 7, 40)
    assert (report["sim_time_s"], report["wall_time_s"]) == (4.0, 2.0)
    assert report["real_time_factor"] == 2.0
    assert set(report["trains"]) == {"train_a"}
    train = report["trains"]["train_a"]
    assert set(train["handovers"]) >= {"expected", "made", "missed", "wrong"}
    ranging = train["phase_ranging"]
    assert set(ranging) >= {"availability", "rmse_m", "bound_m", "p95_m", "max_m"}
    assert ranging["availability"] == 0.0
    assert ranging["rmse_m"] is None


@pytest.mark.parametrize("ticks", [0, 1, 40])
def test_it_is_json_without_nan_and_is_written_whole(tmp_path: Path, ticks: int) -> None:
    report = report_of(tmp_path, ticks)
    path = tmp_path / "report.json"
    path.write_text("what was there before")
    write_report(report, path)

    def refuse(name: str) -> None:
        raise AssertionError(f"{name} is not JSON")

    assert json.loads(path.read_text(), parse_constant=refuse) == json.loads(json.dumps(report))
    assert [p.name for p in tmp_path.iterdir() if "report" in p.name] == ["report.json"]


def test_a_report_that_cannot_be_written_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    path.write_text("old")
    with pytest.raises(ValueError):
        write_report({"rmse_m": math.nan}, path)
    assert path.read_text() == "old"


def test_the_table_shows_failures_and_events(tmp_path: Path) -> None:
    failed = {
        "node": "/wayside/wrs3",
        "reason": "no answer within 2.0 s",
        "detected_by": "/world/radio_medium",
        "time_s": 12.5,
    }
    event = {"time_s": 1.5, "level": "warn", "name": "/wayside/wrs1: zone1", "message": "jammed"}
    fine = {**event, "level": "ok", "message": "undisturbed"}
    report = report_of(tmp_path, 40, failures=[failed], events=[event, fine] * 6)
    assert report["failures"] == [failed]
    assert report["events"] == [event] * 6
    text = shown(report)
    for part in ("train_a", "/wayside/wrs3", "no answer within 2.0 s", "jammed", "3 processes"):
        assert part in text
    assert "undisturbed" not in text


def test_threats_are_shown_where_there_are_any(tmp_path: Path) -> None:
    report = report_of(tmp_path, 40)
    assert "threats" not in report and "threats" not in shown(report)
    report["threats"] = {"frames": 120, "strikes": {"deletion": 7, "delay": 0}}
    link = {"rejected": 5, "forged_accepted": 1, "forged_reports": 2}
    report["trains"]["train_a"]["cbtc"] = link | dict.fromkeys(
        ("frames", "lost", "age_p95_s", "handovers"), 0
    )
    report["trains"]["train_a"]["atp"] = dict.fromkeys(
        ("interventions", "emergency_brakes", "passed_authority", "margin_min_m"), 0
    )
    text = " ".join(shown(report).split())
    assert "threats to 120 frames: deletion 7, delay 0; 5 rejected" in text
    assert "forged and accepted: 1 authorities, 2 reports" in text


def test_a_run_that_never_began_is_shown_as_well(tmp_path: Path) -> None:
    assert "0 ticks" in shown(report_of(tmp_path, 0))
