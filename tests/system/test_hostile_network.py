"""An intruder on the network: trains are held up at most, and nothing he makes is believed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from rail_world.train_radio.frame_threats import Threat

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory


def _judge(report: dict[str, Any]) -> None:
    """Every threat has struck, and nothing forged was believed."""
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


@pytest.mark.system
def test_every_threat_strikes_nothing_forged_is_taken_and_placement_does_not_matter(
    corridor: CorridorFactory,
) -> None:
    # The threats begin at 3 s.
    outcomes = [
        corridor("hostile_network", duration_s=7.0, placement=placement).run_to_end()
        for placement in ("one", "site")
    ]
    assert outcomes[0].digest == outcomes[1].digest
    assert outcomes[0].report["threats"] == outcomes[1].report["threats"]
    for outcome in outcomes:
        _judge(outcome.report)
