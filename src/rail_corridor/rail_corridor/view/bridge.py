"""The viewer's end in the ROS graph: finds topics, reads them, and hands out frames.

Nothing of it runs by itself: `Bridge.poll` is called a few times a second, and takes the newest
message of each topic. Between two calls no Python runs for a message that comes.
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from rail_corridor.equipment.registry import live_views

from .frame import Asked, Lists, frame
from .layout import panel_of
from .live_state import LiveStateStore
from .switches import Switches, equipment_of, natural
from .taps import Taps
from .wanted import Wish, is_waveform, wanted

#: Wall time between two looks at which topics there are.
DISCOVERY_S = 1.0
#: ... and at which equipment can be switched.
SERVICES_S = 2.5
#: What a browser asked for is kept up for this long after it last asked.
WISH_S = 3.0
_MOST_BROWSERS = 16


class Bridge:
    """Reads a corridor in one ROS domain.

    Parameters
    ----------
    domain : int
    """

    def __init__(self, domain: int) -> None:
        self._context = rclpy.Context()
        rclpy.init(
            context=self._context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        name = f"rail_view_{os.getpid()}"
        self._node = Node(
            name, context=self._context, start_parameter_services=False, enable_rosout=False
        )
        self._switches = Switches(self._context, f"{name}_switches")
        self._taps = Taps(self._node)
        self.state = LiveStateStore()
        self.lists = Lists()
        self._names: Mapping[str, Any] = {}
        self._wishes: dict[str, tuple[float, Wish]] = {}
        self._discover_s = self._services_s = 0.0

    def poll(self) -> None:
        """Take what has come, and adapt to what there is and to who looks at what."""
        now_s = time.monotonic()
        if now_s >= self._discover_s:
            self._discover_s = now_s + DISCOVERY_S
            self._discover(services=now_s >= self._services_s)
        self._hold(now_s)
        for name, raw in self._taps.take():
            self.state.feed(name, raw, now_s)
        self.state.look(writers=self._taps.writers("/world/state"))

    def frame(self, browser: str, asked: Asked) -> dict[str, Any]:
        """Message for one browser, which is remembered for what it looks at."""
        now_s = time.monotonic()
        panel = panel_of(asked.tab)
        wish = Wish(
            train=asked.train,
            telegrams=panel is not None and panel.log,
            scope=asked.scope if asked.tab == "scope" else "",
        )
        new = browser not in self._wishes or self._wishes[browser][1] != wish
        self._wishes[browser] = (now_s, wish)
        if new:
            while len(self._wishes) > _MOST_BROWSERS:
                self._wishes.pop(min(self._wishes, key=lambda b: self._wishes[b][0]))
            self._hold(now_s)
        return frame(self.state, asked, self.lists, self._taps.writers, now_s)

    def switch(self, equipment: str, *, on: bool) -> str:
        """Switch equipment; returns why it did not work. For a thread of its own: it waits."""
        if equipment not in self.lists.equipment:
            return "there is no such equipment to switch"
        return self._switches.set(equipment, on=on)

    def close(self) -> None:
        """Leave the graph."""
        self._taps.hold({})
        self._switches.close()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def _discover(self, *, services: bool) -> None:
        self._names = dict(self._node.get_topic_names_and_types())
        equipment = self.lists.equipment
        if services:
            self._services_s = time.monotonic() + SERVICES_S
            equipment = equipment_of(self._node.get_service_names_and_types())
        waveforms = tuple(
            sorted(
                (name for name, types in self._names.items() if is_waveform(name, types)),
                key=natural,
            )
        )
        if (waveforms, equipment) != (self.lists.waveforms, self.lists.equipment):
            self.lists = Lists(self.lists.version + 1, waveforms, equipment)

    def _hold(self, now_s: float) -> None:
        self._wishes = {
            browser: (seen_s, wish)
            for browser, (seen_s, wish) in self._wishes.items()
            if now_s - seen_s < WISH_S
        }
        wishes = {wish for _, wish in self._wishes.values()}
        state = self.state
        details = {
            wish.train: [name for view in live_views() for name in view.details(state, wish.train)]
            for wish in wishes
            if wish.train
        }
        self._taps.hold(wanted(self._names, wishes, details, ticking=state.ticking))
