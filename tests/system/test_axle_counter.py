"""Equipment from another distribution: installed and run, and no file of the project knows it.

The distribution is installed as by a user, but into a directory of its own: who has that on the
path of Python has the equipment, everybody else has not.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rail_corridor.equipment.registry import node_kinds
from rail_corridor.loading.loader import builtin_scenarios

if TYPE_CHECKING:
    from .conftest import Rail

pytestmark = pytest.mark.system
ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "axle_counter"
#: What only this equipment has: module, section, topics, faults, kinds of nodes.
NAMES = re.compile(
    r"axle_counters|axle_counter\.|wheel_sensor|detection_point|axle_evaluator|missed_axles|rail_brake"
)


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the distribution, from a copy: building leaves files beside the sources."""
    directory = tmp_path_factory.mktemp("axle_counter")
    copy = shutil.copytree(EXAMPLE, directory / "source")
    target = directory / "site-packages"
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    offline = ["--no-deps", "--no-build-isolation", "--no-index", "--no-compile"]
    done = subprocess.run(
        [*command, *offline, "--target", str(target), str(copy)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return target


@pytest.fixture
def with_it(rail: Rail, installed: Path, monkeypatch: pytest.MonkeyPatch) -> Rail:
    """Return a runner of ``rail`` in an environment that has the distribution."""
    monkeypatch.setenv("PYTHONPATH", str(installed))
    return rail


def shipped(installed: Path) -> str:
    """Return the scenario that comes with the distribution."""
    return (installed / "axle_counter" / "scenarios" / "counted_line.yaml").read_text()


def test_it_is_checked_run_and_reported(with_it: Rail) -> None:
    check = with_it.start("check", "counted_line")
    assert with_it.finish(check) == 0, with_it.errors(check)
    assert "section acs1: main 200..650 m, between dp1, dp2" in with_it.output(check)
    report = with_it.report("counted_line", "--processes", "one")
    counted = report["axle_counter"]
    assert counted["axles"] == counted["counted"] == 3 * 24
    for name in ("miscounts", "unclear", "free_while_occupied_ticks", "not_known_ticks"):
        assert counted[name] == 0
    assert report["missing_ticks"] == 0
    assert report["failures"] == []
    shown = with_it.output(with_it.started[-1])
    assert "axles at detection points" in shown
    assert "sections of the axle counter" in shown


def test_a_miscount_and_a_dead_point_are_in_the_report(with_it: Rail, installed: Path) -> None:
    fault = "faults:\n  - {kind: missed_axles, point: dp1, every: 3}\n"
    path = with_it.directory / "loose_head.yaml"
    path.write_text(shipped(installed) + fault)
    kill = ("--kill", "/wayside/dp3/wheel_sensor@20", "--timeout", 5)
    told = with_it.directory / "told.json"
    run = with_it.start(
        "run", path, "--processes", "one", "--duration", 40, *kill, "--report", told
    )
    # A section that is told to be free with a train in it is not safe.
    assert with_it.finish(run) == 3, with_it.errors(run)
    report = json.loads(told.read_text())
    assert report["verdict"] == "unsafe"
    points, sections = (report["axle_counter"][name] for name in ("points", "sections"))
    assert points["dp1"]["miscounts"] == 8
    assert points["dp2"]["miscounts"] == 0
    assert sections["acs1"]["free_while_occupied_ticks"] > 0
    # A section with a border that is dead is not known; it was 20 s before.
    assert sections["acs2"]["free_while_occupied_ticks"] == 0
    assert sections["acs2"]["not_known_ticks"] == pytest.approx(200, abs=2)
    assert [failed["node"] for failed in report["failures"]] == ["/wayside/dp3/wheel_sensor"]


def test_a_recording_is_reported_where_it_is_installed_and_refused_elsewhere(
    with_it: Rail, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = ("counted_line", "--processes", "one", "--duration", 15)
    report = with_it.report(*short, "--record", with_it.directory / "run.mcap")
    again = with_it.start("report", "run.mcap", "--json", "again.json")
    assert with_it.finish(again) == 0, with_it.errors(again)
    assert "not what the run itself reported" not in with_it.output(again)
    assert json.loads((with_it.directory / "again.json").read_text()) == report
    assert report["axle_counter"]["counted"] == 24
    sites = with_it.report("counted_line", "--processes", "site", "--duration", 15)
    assert sites["digest"] == report["digest"] and sites["processes"] > 10
    assert sites["axle_counter"] == report["axle_counter"]
    monkeypatch.setenv("PYTHONPATH", "")
    refused = with_it.start("report", "run.mcap")
    assert with_it.finish(refused) == 2
    assert "axle_counters" in with_it.errors(refused)
    assert "there is no such field" in with_it.errors(refused)
    assert with_it.errors(refused).count("\n") == 1


def test_a_wrong_field_of_its_section_is_one_line(with_it: Rail, installed: Path) -> None:
    path = with_it.directory / "wrong.yaml"
    path.write_text(shipped(installed).replace("margin_m: 200", "marginm: 200"))
    check = with_it.start("check", path)
    assert with_it.finish(check) == 2
    line = "axle_counters.marginm: 200: there is no such field, did you mean margin_m"
    assert with_it.errors(check) == f"rail: {path}: {line}\n"


def test_its_own_tests_pass_where_it_is_installed(with_it: Rail) -> None:
    ini = ["-c", str(EXAMPLE / "pyproject.toml"), "--rootdir", str(EXAMPLE)]
    flags = ["-q", "-p", "no:cacheprovider", *ini]
    command = [sys.executable, "-m", "pytest", *flags, str(EXAMPLE / "tests")]
    run = with_it.start(command=command)
    assert with_it.finish(run) == 0, with_it.output(run)
    assert re.search(r"\d\d passed", with_it.output(run))


def test_its_contracts_are_kept(with_it: Rail) -> None:
    lint = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"]
    run = with_it.start(command=[*lint, "--config", str(EXAMPLE / "pyproject.toml")])
    assert with_it.finish(run) == 0, with_it.output(run) + with_it.errors(run)
    assert "3 kept, 0 broken" in with_it.output(run)


def test_its_topics_are_in_the_reference_where_it_is_installed(with_it: Rail) -> None:
    for run in (
        with_it.start(command=[sys.executable, "-m", "rail_corridor.cli.topic_docs"]),
        with_it.start("scenarios"),
    ):
        assert with_it.finish(run) == 0, with_it.errors(run)
    document, scenarios = (with_it.output(run) for run in with_it.started)
    assert "| `/wayside/<point>/wheel_sensor/passages` |" in document
    assert "### axle_evaluator" in document
    assert "cbtc_medium, reference_medium, wheel_sensor_medium, the report" in document
    assert "counted_line" in scenarios


def test_the_project_without_it_knows_nothing_of_it() -> None:
    assert not {name for name in node_kinds() if NAMES.search(name)}
    assert "counted_line" not in builtin_scenarios()
    knowing = [
        str(path.relative_to(ROOT))
        for pattern in ("src/**/*.py", "src/**/*.yaml", "src/**/*.js", "pyproject.toml")
        for path in sorted(ROOT.glob(pattern))
        if NAMES.search(path.read_text(encoding="utf-8"))
    ]
    assert knowing == []
