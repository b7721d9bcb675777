"""The settings of the middleware that the launcher ships."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from importlib import resources
from pathlib import Path
from typing import Literal

import pytest

from rail_corridor.middleware.discovery import discover_on

#: Port numbers of the DDS interoperability protocol: gain of a domain, offset and gain of a
#: participant's unicast ports.
DOMAIN_GAIN, UNICAST_OFFSET, PARTICIPANT_GAIN = 250, 11, 2
#: Headers of IPv4 and UDP in a packet of Ethernet [octets].
ETHERNET_MTU, HEADERS = 1500, 20 + 8

ONE_HOST, SEVERAL_HOSTS = "fastdds.xml", "fastdds_hosts.xml"


def settings(name: str) -> dict[str, str]:
    """Return every value of a profile by its path: tags, and the type of a transport."""
    text = (resources.files("rail_corridor.middleware") / name).read_text()
    found: dict[str, str] = {}

    def visit(node: ElementTree.Element, path: str) -> None:
        tag = node.tag.rsplit("}", 1)[-1]
        if tag == "transport_descriptor":
            tag = next(child.text or "" for child in node if child.tag.endswith("}type"))
        path = f"{path}/{tag}" if path else tag
        if not len(node):
            found[path] = ",".join(filter(None, (found.get(path), node.text)))
        for child in node:
            visit(child, path)

    visit(ElementTree.fromstring(text), "")
    return {path.removeprefix("dds/profiles/"): value for path, value in found.items()}


@pytest.mark.parametrize("name", [ONE_HOST, SEVERAL_HOSTS])
def test_discovery_stays_within_the_ports_of_one_domain(name: str) -> None:
    peers = int(settings(name)["transport_descriptors/UDPv4/maxInitialPeersRange"])
    assert UNICAST_OFFSET + PARTICIPANT_GAIN * (peers - 1) < DOMAIN_GAIN


def test_between_hosts_messages_fit_a_packet_and_losses_are_answered_at_once() -> None:
    one, several = settings(ONE_HOST), settings(SEVERAL_HOSTS)
    more = {path: value for path, value in several.items() if one.get(path) != value}
    assert one.items() <= several.items()
    # An initialAcknackDelay of zero would be a storm: it is doubled from try to try.
    assert more == {
        "transport_descriptors/UDPv4/maxMessageSize": str(ETHERNET_MTU - HEADERS),
        "data_writer/times/heartbeatPeriod/nanosec": "10000000",
        "data_writer/times/nackResponseDelay/nanosec": "0",
        "data_writer/times/nackSupressionDuration/nanosec": "0",
        "data_reader/times/heartbeatResponseDelay/nanosec": "0",
    }


@pytest.mark.parametrize(
    ("hosts", "reach", "profile"),
    [("this", "LOCALHOST", ONE_HOST), ("all", "SUBNET", SEVERAL_HOSTS)],
)
def test_reach_and_profile_follow_the_hosts_unless_the_user_has_set_them(
    monkeypatch: pytest.MonkeyPatch, hosts: Literal["this", "all"], reach: str, profile: str
) -> None:
    names = ("ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTRTPS_DEFAULT_PROFILES_FILE")
    for name in names:
        monkeypatch.setenv(name, "mine")
    discover_on(hosts)
    assert [os.environ[name] for name in names] == ["mine", "mine"]
    for name in names:
        monkeypatch.delenv(name)
    discover_on(hosts)
    assert os.environ[names[0]] == reach
    path = Path(os.environ[names[1]])
    assert path.name == profile and path.is_file()
