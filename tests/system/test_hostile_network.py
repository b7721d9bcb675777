"""An intruder on the network: trains are held up at most, and nothing he makes is believed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rail_world.train_radio.frame_threats import Threat

if TYPE_CHECKING:
    from .conftest import Rail

pytestmark = pytest.mark.system


def test_every_threat_strikes_nothing_forged_is_taken_and_placement_does_not_matter(
    rail: Rail,
) -> None:
    # The threats begin at 3 s.
    scenario = ("hostile_network", "--duration", 7, "--processes")
    reports = [rail.report(*scenario, "one"), rail.recorded(*scenario, "site")]
    assert reports[0]["digest"] == reports[1]["digest"]
    assert reports[0]["threats"] == reports[1]["threats"]
    assert reports[0]["processes"] == 1 < reports[1]["processes"]
    for report in reports:
        assert report["failures"] == [] and report["missing_ticks"] == 0
        assert set(report["threats"]["strikes"]) == {threat.value for threat in Threat}
        assert all(count > 0 for count in report["threats"]["strikes"].values())
        # Four trains, both ways, all but the first tick on the way up.
        assert report["threats"]["frames"] == 4 * (28 + 27)
        for train in report["trains"].values():
            link, atp = train["cbtc"], train["atp"]
            assert link["rejected"] > 0 and link["reports_taken"] > 15
            assert link["forged_accepted"] == link["forged_reports"] == 0
            assert link["mislocated"] == atp["passed_authority"] == 0
            assert train["distance_m"] > 10.0
