"""The same scenario and seed give the same estimates, wherever and however fast it runs.

Some are recorded, which changes nothing either.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from rail_corridor import simulate

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory

    from .conftest import Rail

pytestmark = pytest.mark.system
_SECONDS = 6.0


def _whole(report: dict[str, Any]) -> bool:
    """Whether nothing was lost on the way to the report."""
    return bool(
        report["complete"]
        and report["ticks"] == 10 * _SECONDS
        and report["missing_ticks"] == 0
        and not report["failures"]
    )


def test_every_placement_and_rate_gives_the_same_digest(
    rail: Rail, corridor: CorridorFactory
) -> None:
    run = ("branch", "--duration", _SECONDS, "--processes")
    runs = {
        ("one", 0): corridor("branch", duration_s=_SECONDS).run_to_end().report,
        ("site", 0): rail.recorded(*run, "site"),
        ("node", 0): rail.report(*run, "node"),
        ("one", 8): rail.report(*run, "one", "--rate", 8),
    }
    runs["loop", 0] = simulate("branch", duration_s=_SECONDS).run().report
    assert all(_whole(report) for report in runs.values())
    assert len({report["digest"] for report in runs.values()}) == 1
    # As many processes as were asked for, and pacing that keeps to its rate.
    assert runs["one", 0]["processes"] == 1
    assert 1 < runs["site", 0]["processes"] < runs["node", 0]["processes"]
    assert runs["node", 0]["processes"] == runs["node", 0]["nodes"]
    assert runs["one", 8]["real_time_factor"] <= 8.2


def test_two_runs_are_alike_and_another_seed_is_not(corridor: CorridorFactory) -> None:
    first, again, other = (
        corridor("plain_line", duration_s=_SECONDS, seed=seed).run_to_end().report
        for seed in (7, 7, 99)
    )
    assert first["digest"] == again["digest"] != other["digest"]
    assert _whole(first) and _whole(again) and _whole(other)
