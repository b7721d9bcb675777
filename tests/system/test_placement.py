"""The same scenario and seed give the same estimates, wherever and however fast it runs.

Some are recorded, which changes nothing either.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from .conftest import Rail

pytestmark = pytest.mark.system
_SECONDS = 6


def _whole(report: dict[str, Any]) -> bool:
    """Whether nothing was lost on the way to the report."""
    return bool(
        report["complete"]
        and report["ticks"] == 10 * _SECONDS
        and report["missing_ticks"] == 0
        and not report["failures"]
    )


def test_every_placement_and_rate_gives_the_same_digest(rail: Rail) -> None:
    runs = {
        ("one", 0): rail.report("branch", "--duration", _SECONDS, "--processes", "one"),
        ("site", 0): rail.recorded("branch", "--duration", _SECONDS, "--processes", "site"),
        ("node", 0): rail.report("branch", "--duration", _SECONDS, "--processes", "node"),
        ("one", 8): rail.report(
            "branch", "--duration", _SECONDS, "--processes", "one", "--rate", 8
        ),
    }
    assert all(_whole(report) for report in runs.values())
    assert len({report["digest"] for report in runs.values()}) == 1
    # As many processes as were asked for, and pacing that keeps to its rate.
    assert runs["one", 0]["processes"] == 1
    assert 1 < runs["site", 0]["processes"] < runs["node", 0]["processes"]
    assert runs["node", 0]["processes"] == runs["node", 0]["nodes"]
    assert runs["one", 8]["real_time_factor"] <= 8.2


def test_two_runs_are_alike_and_another_seed_is_not(rail: Rail) -> None:
    first = rail.report("plain_line", "--duration", _SECONDS, "--processes", "one")
    again = rail.report("plain_line", "--duration", _SECONDS, "--processes", "one")
    other = rail.report("plain_line", "--duration", _SECONDS, "--processes", "one", "--seed", 99)
    assert first["digest"] == again["digest"] != other["digest"]
    assert _whole(first) and _whole(again) and _whole(other)
