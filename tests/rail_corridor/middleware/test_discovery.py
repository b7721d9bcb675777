"""The settings of the middleware that the launcher ships."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from importlib import resources

#: Port numbers of the DDS interoperability protocol: gain of a domain, offset and gain of a
#: participant's unicast ports.
DOMAIN_GAIN, UNICAST_OFFSET, PARTICIPANT_GAIN = 250, 11, 2


def test_discovery_stays_within_the_ports_of_one_domain() -> None:
    profile = ElementTree.fromstring(
        (resources.files("rail_corridor.middleware") / "fastdds.xml").read_text()
    )
    ranges = [int(node.text or 0) for node in profile.iter() if "maxInitialPeersRange" in node.tag]
    assert ranges
    for peers in ranges:
        assert UNICAST_OFFSET + PARTICIPANT_GAIN * (peers - 1) < DOMAIN_GAIN
