"""Deliberately wrong implementations: each is caught, with a reason that leads to its error."""

from __future__ import annotations

import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

pytestmark = pytest.mark.system
HERE = Path(__file__).parent

WRONG = [
    (
        "atp",
        "wrong_atp_ignores_age.py",
        "too_old",
        r"authority is at least [\d.]+ s old, 3 s are allowed, and it demands no brake",
    ),
    (
        "vrs",
        "wrong_vrs_delay.py",
        "calibration",
        r"its delay is 1\.\d+ us; it is calibrated to 1\.000 us",
    ),
    (
        "zone_controller",
        "wrong_zone_controller_middle.py",
        "given_to_two",
        r"beyond the rear of \w+ at [\d.]+ m: two trains may be on the same stretch",
    ),
    (
        "track_code_receiver",
        "wrong_receiver_holds.py",
        "ceases and silence",
        r"is still valid, though no code has come",
    ),
    (
        "localizer",
        "wrong_localizer_half.py",
        "deviation_demands or edge",
        r"alone demands|outside of the interval from",
    ),
]


@pytest.mark.parametrize(("kind", "program", "keyword", "reason"), WRONG)
def test_a_wrong_one_is_caught(
    kind: str, program: str, keyword: str, reason: str, tmp_path: Path
) -> None:
    junit, page = tmp_path / "result.xml", tmp_path / "result.html"
    command = f"{sys.executable} {HERE / program}"
    words = [kind, "--command", command, "-k", keyword, "--record", str(tmp_path)]
    words += ["--junit", str(junit), "--html", str(page)]
    done = subprocess.run(
        [sys.executable, "-m", "rail_testing.conformance", *words],
        capture_output=True,
        text=True,
        timeout=240,
    )
    assert done.returncode == 1, done.stdout[-3000:] + done.stderr[-2000:]
    assert re.search(reason, done.stdout), done.stdout[-3000:]
    assert re.search(r"recording: .*\.mcap", done.stdout)
    assert "requirement" in {each.get("name") for each in ET.parse(junit).iter("property")}
    assert "failed" in page.read_text() and ".mcap" in page.read_text()


def test_wrong_use_is_one_line() -> None:
    for words, line in (
        (["atq"], "KIND: 'atq': must be one of atp"),
        (
            ["atp", "--command", "no_such_program_"],
            "--command: 'no_such_program_': there is no such program",
        ),
        (["atp", "--list", "-k", "no_such_test"], "-k: 'no_such_test': selects no test"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", "rail_testing.conformance", *words],
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.returncode == 2
        assert line in done.stderr and len(done.stderr.splitlines()) == 1
