"""Which topics are read, and when."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from rail_corridor.equipment.registry import kind_of, topics
from rail_corridor.view.switches import SERVICE_TYPE, equipment_of
from rail_corridor.view.wanted import ARRAY, STANDING, Wish, awaited, is_waveform, of_train, wanted
from rail_msgs_py.topics.topic import Topic

ODOMETRY = ("nav_msgs/msg/Odometry",)
NAMES: dict[str, tuple[str, ...]] = {
    "/clock": ("rosgraph_msgs/msg/Clock",),
    "/world/state": (ARRAY,),
    "/world/main/path": ("nav_msgs/msg/Path",),
    "/world/radio_medium/links": (ARRAY,),
    "/wayside/zone_controller/a/position": ODOMETRY,
    "/wayside/zone_controller/b/position": ODOMETRY,
    "/wayside/zone_controller/a/authority": (ARRAY,),
    "/wayside/wrs1/zone1/range": ("sensor_msgs/msg/Range",),
    "/wayside/wrs1/zone1/tx": (ARRAY,),
    "/a/vrs/channel": (ARRAY,),
    "/a/vrs/tx": (ARRAY,),
    "/a/atp/command": (ARRAY,),
    "/a/odometer": (ARRAY,),
    "/a/stranger/fix": (ARRAY,),
    "/a/localizer/state": (ARRAY,),
    "/b/localizer/state": (ARRAY,),
    "/b/doppler/fix": (ARRAY,),
    "/b/odometer": (ARRAY,),
    "/a/atp/telegrams": ("std_msgs/msg/UInt8MultiArray",),
}
STANDING_NAMES = {topic.name() for topic in STANDING}


def held(*wishes: Wish, ticking: bool = True) -> set[str]:
    zones = {"a": ["/wayside/wrs1/zone1/range", "/wayside/gone/zone9/range"]}
    return set(wanted(NAMES, wishes, zones, ticking=ticking)) - STANDING_NAMES


OVERVIEW = {
    *("/world/main/path", "/wayside/zone_controller/a/position", "/a/vrs/channel"),
    *("/wayside/zone_controller/b/position", "/wayside/zone_controller/a/authority"),
}
#: Other nodes wait for their reader on these.
AWAITED = {"/a/atp/command", "/a/localizer/state", "/b/localizer/state"}


def test_the_overview_is_read_for_every_train() -> None:
    assert held() == {*OVERVIEW, *AWAITED}
    assert held(ticking=False) == OVERVIEW


def test_details_are_read_of_the_train_that_is_looked_at() -> None:
    more = {"/a/odometer", "/a/stranger/fix", "/wayside/wrs1/zone1/range"}
    assert held(Wish(train="a")) == {*OVERVIEW, *AWAITED, *more}


def test_waveforms_and_telegrams_are_read_while_they_are_looked_at() -> None:
    assert held(Wish(scope="/a/vrs/tx")) - held() == {"/a/vrs/tx"}
    assert held(Wish(scope="/not/there")) == held()
    assert held(Wish(scope="/clock")) == held()
    assert held(Wish(telegrams=True)) - held() == {"/a/atp/telegrams"}


@pytest.mark.parametrize("wish", [Wish("a", True, "/a/vrs/tx"), Wish("b", True, "/world/state")])
def test_before_the_first_tick_nothing_is_read_that_a_node_waits_for(wish: Wish) -> None:
    for name in held(wish, ticking=False):
        kind = kind_of(name)
        assert kind is not None, name
        assert not awaited(kind)
    # Even while ticks run the clock is not: the world counts its readers at the start.
    assert "/clock" not in held(wish)


def names_of(topic: Topic) -> list[str]:
    """Names under which modules define a topic."""
    modules = [module for name, module in sys.modules.items() if "rail_msgs_py.topics." in name]
    return [name for m in modules for name, value in vars(m).items() if value is topic]


def test_what_nodes_wait_for_is_known() -> None:
    sources = (Path(__file__).resolve().parents[3] / "src").glob("rail_*/rail_*/**/*_node.py")
    found: set[str] = set()
    for path in sources:
        found |= set(re.findall(r"stream_out\(\s*([A-Z_]+)", path.read_text()))
    assert len(found) > 15
    named = {name: topic for topic in topics() for name in names_of(topic)}
    assert {name for name in found if not awaited(named[name])} == set()


def test_truth_is_kept_for_many_ticks_and_events_for_all() -> None:
    taps = wanted(NAMES, (), {}, ticking=False)
    assert not taps["/world/state"].latched
    assert taps["/world/state"].depth > 8
    assert taps["/failed"].latched
    assert not taps["/diagnostics"].latched  # all of it comes again within a second
    assert taps["/a/vrs/channel"].depth == 1


def test_kinds_are_told_by_name_or_type() -> None:
    assert is_waveform("/a/vrs/tx", (ARRAY,))
    assert is_waveform("/a/stranger/rx", (ARRAY,))
    assert not is_waveform("/a/vrs/channel", (ARRAY,))
    assert not is_waveform("/clock", NAMES["/clock"])
    assert of_train("/world/state") == "world"


def test_equipment_is_what_offers_the_lifecycle_service() -> None:
    services = [
        ("/wayside/wrs2/change_state", [SERVICE_TYPE]),
        ("/wayside/wrs1/change_state", [SERVICE_TYPE]),
        ("/wayside/wrs1/get_state", ["lifecycle_msgs/srv/GetState"]),
        ("/else/change_state", ["std_srvs/srv/Trigger"]),
    ]
    assert equipment_of(services) == ("/wayside/wrs1", "/wayside/wrs2")
