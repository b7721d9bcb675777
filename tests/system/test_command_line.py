"""Wrong use of any command: exit code 2, one line on standard error, nothing on standard output."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from rail_corridor.cli import main as cli

if TYPE_CHECKING:
    from .conftest import Rail

BROKEN_YAML = "name: [unclosed\nseed: 1\n"
WRONG_FIELD = "name: x\nduration_s: -1\ntracks: {}\nstations: {zone_length_m: 200}\n"


@pytest.fixture
def directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a directory with files that cannot be used, and go there."""
    (tmp_path / "broken.yaml").write_text(BROKEN_YAML)
    (tmp_path / "wrong.yaml").write_text(WRONG_FIELD)
    (tmp_path / "empty.yaml").write_text("")
    (tmp_path / "binary.yaml").write_bytes(bytes(range(256)))
    (tmp_path / "broken.json").write_text('{"stops": ')
    (tmp_path / "wrong.json").write_text('{"stops": "none"}')
    (tmp_path / "folder").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("nonsense", "nonsense"),
        ("--nonsense", "--nonsense"),
        ("run", "SCENARIO"),
        ("run no_such_scenario", "no_such_scenario"),
        ("run missing.yaml", "missing.yaml"),
        ("run folder", "folder"),
        ("run broken.yaml", "broken.yaml"),
        ("run wrong.yaml", "duration_s"),
        ("run empty.yaml", "empty.yaml"),
        ("run binary.yaml", "binary.yaml"),
        ("run demo extra", "extra"),
        ("run demo --no-such-option", "--no-such-option"),
        ("run demo --rate nan", "--rate"),
        ("run demo --rate inf", "--rate"),
        ("run demo --rate -1", "--rate"),
        ("run demo --rate fast", "--rate"),
        ("run demo --rate", "--rate"),
        ("run demo --processes x", "--processes"),
        ("run demo --only half", "--only"),
        ("plan no_such_scenario", "no_such_scenario"),
        ("plan demo --duration 0", "--duration"),
        ("plan demo --write broken.yaml", "--write"),
        ("plan demo --write missing/folder", "--write"),
        ("run demo --timeout 0", "--timeout"),
        ("run demo --timeout nan", "--timeout"),
        ("run demo --duration 0", "--duration"),
        ("run demo --record run.txt", "--record"),
        ("run demo --record missing/run.mcap", "--record"),
        ("run demo --record run.mcap --only onboard", "--record"),
        ("run demo --record run.mcap --record-topics /nobody/*", "--record-topics: '/nobody/*'"),
        ("run demo --record run.mcap --record-topics a,,b", "--record-topics: 'a,,b'"),
        ("run demo --record run.mcap --record-split 0.5", "--record-split: 0.5"),
        ("run demo --record run.mcap --record-split nan", "--record-split: nan"),
        ("run demo --record-topics *", "--record-topics: needs --record"),
        ("run demo --no-waveforms", "--no-waveforms: needs --record"),
        ("run demo --record-split 10", "--record-split: needs --record"),
        ("report", "FILE.mcap"),
        ("report missing.mcap", "missing.mcap"),
        ("report folder", "folder"),
        ("report binary.yaml", "binary.yaml"),
        ("report empty.yaml", "empty.yaml"),
        ("replay missing.mcap", "missing.mcap"),
        ("replay binary.yaml", "binary.yaml"),
        ("replay binary.yaml --rate 0", "--rate"),
        ("replay binary.yaml --start nan", "--start"),
        ("replay binary.yaml --duration -1", "--duration"),
        ("run demo --duration nan", "--duration"),
        ("run demo --duration 1e99", "--duration"),
        ("run demo --seed -1", "--seed"),
        ("run demo --seed 1.5", "--seed"),
        ("run demo --trains 0", "--trains"),
        ("run demo --trains many", "--trains"),
        ("run demo --zone-length 1", "--zone-length"),
        ("run demo --zone-length nan", "--zone-length"),
        ("run demo --track missing.json", "missing.json"),
        ("run demo --track broken.json", "broken.json"),
        ("run demo --track wrong.json", "stops"),
        ("run demo --track folder", "folder"),
        ("run demo --report nowhere/report.json", "--report"),
        ("run demo --report folder", "--report"),
        ("run demo --external /no/such/node", "--external"),
        ("run demo --external /world", "--external"),
        ("check", "SCENARIO"),
        ("check no_such_scenario", "no_such_scenario"),
        ("check broken.yaml", "broken.yaml"),
        ("check demo --duration -5", "--duration"),
        ("check demo --rate 1", "--rate"),
        ("scenarios extra", "extra"),
        ("echo", "TOPIC"),
        ("hz", "TOPIC"),
        ("hz clock", "/clock"),
        ("echo /clock --format xml", "--format"),
        ("echo /clock --every 0", "--every"),
        ("echo /clock --count -1", "--count"),
        ("echo /clock --field a,,b", "--field"),
        ("echo /clock --where clock.sec=3", "--where"),
        ("plot", "TOPIC.FIELD"),
        ("plot /clock", "/clock"),
        ("plot /clock.clock.sec --out clock.gif", "--out"),
        ("plot /clock.clock.sec --seconds 0", "--seconds"),
        ("plot /clock.clock.sec --last nan", "--last"),
        ("plot /clock.clock.sec --from run.mcap --seconds 3", "--seconds"),
        ("plot /clock.clock.sec --from missing.mcap", "missing.mcap"),
        ("plot /train_a/odometer.speed --from missing.mcap", "speed"),
        ("topics extra", "extra"),
        ("bench --json nowhere/rows.json", "--json"),
        ("profile", "SCENARIO"),
        ("profile no_such_scenario", "no_such_scenario"),
        ("profile demo --duration 2", "duration_s"),
        ("profile demo --flame flame.svg", "--flame"),
        ("profile demo --flame nowhere/flame.html", "--flame"),
        ("profile demo --json folder", "--json"),
        ("study everything", "everything"),
        ("campaign everything", "everything"),
        ("study handover --runs 0", "--runs"),
        ("study handover --runs many", "--runs"),
        ("study handover --seed -1", "--seed"),
        ("study handover --crossings 3", "--crossings"),
        ("study handover --out nowhere/rows", "--out"),
        ("study handover --set runs", "--set"),
        ("study handover --set run=3", "run"),
        ("study handover --only 99:0", "--only"),
        ("study handover --compare nowhere", "--compare"),
        ("study handover --workers 2 --scheduler tcp://127.0.0.1:1", "--workers"),
        ("draw everything", "everything"),
        ("draw handover --set speed_kmh=9000", "speed_kmh"),
    ],
)
def test_wrong_use_is_one_line(
    directory: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    arguments: str,
    told: str,
) -> None:
    monkeypatch.setattr(sys, "argv", ["rail", *arguments.split()])
    with pytest.raises(SystemExit) as end:
        cli.main()
    output, errors = capfd.readouterr()
    assert end.value.code == 2
    assert output == ""
    assert errors.count("\n") == 1 and errors.endswith("\n")
    assert errors.startswith("rail: ")
    assert told in errors


@pytest.mark.system
def test_the_command_itself_says_it_too(rail: Rail) -> None:
    run = rail.start("run", "demo", "--rate", "nan")
    assert rail.finish(run) == 2
    assert rail.output(run) == ""
    assert rail.errors(run) == "rail: --rate: nan: must be from 0 to 1e6\n"
