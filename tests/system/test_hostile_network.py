"""An intruder on the network: trains are held up at most, and nothing he makes is believed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rail_world.train_radio.frame_threats import Threat

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory


def test_every_threat_strikes_and_nothing_forged_is_taken(corridor: CorridorFactory) -> None:
    # The threats begin at 3 s.
    report = corridor("hostile_network", duration_s=7.0).run_to_end().report
    assert report["failures"] == [] and report["missing_ticks"] == 0
    assert set(report["threats"]["strikes"]) == {threat.value for threat in Threat}
    assert all(count > 0 for count in report["threats"]["strikes"].values())
    # Four trains, both ways, two frames a second.
    assert report["threats"]["frames"] == 4 * (14 + 14)
    for train in report["trains"].values():
        link, atp = train["cbtc"], train["atp"]
        assert link["rejected"] > 0 and link["reports_taken"] > 7
        assert link["forged_accepted"] == link["forged_reports"] == 0
        assert link["mislocated"] == atp["passed_authority"] == 0
        assert train["distance_m"] > 10.0
