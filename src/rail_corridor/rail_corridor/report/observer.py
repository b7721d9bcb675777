"""The report's ear: a node that reads truth and estimates from the running corridor."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from std_msgs.msg import Header

from rail_corridor.equipment.map_scene import MapScene
from rail_corridor.plan.plan import REPORT, Plan
from rail_corridor.run_data import RunData
from rail_msgs_py.failures import failure
from rail_msgs_py.health import node_of_health
from rail_msgs_py.node import CorridorNode
from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.topics.qos import OBSERVER_WINDOW_TICKS
from rail_msgs_py.topics.tick import DIAGNOSTICS, FAILED, OBSERVED
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.world import MAP_POSE, STATE, TRAIN_MARKERS
from rail_signals.arrays import FloatArray

from .intake import Intake
from .map_markers import train_markers
from .map_poses import TRUTH, locators_of, map_poses

NAME = REPORT.strip("/")


class Observer(CorridorNode):
    """Records a run; says when it has ended.

    Parameters
    ----------
    plan : Plan
    on_progress : callable
        Called about ten times a second of wall time.
    record : bool
        False where the report is made on another host.
    alone : bool
        Whether all nodes of the corridor are in this process.
    """

    def __init__(
        self,
        plan: Plan,
        on_progress: Callable[[], None],
        *,
        context: Any = None,
        record: bool = True,
        alone: bool = False,
    ) -> None:
        super().__init__(NAME, "/", context=context, services=False)
        self._tick_ns = plan.world.tick_ns
        self.intake = Intake(plan)
        self._failed = self.publisher(FAILED)
        if record:
            self._network = plan.world.network()
            self._first_tracks = tuple(train.route[0] for train in plan.world.trains)
            self._markers = self.publisher(TRAIN_MARKERS)
            self._locators = locators_of(plan.records)
            sources = (TRUTH, *(each.name for each in self._locators))
            self._poses = {
                (train, source): self.publisher(MAP_POSE, train=train, source=source)
                for train in self.recording.trains
                for source in sources
            }
            self._observed = self.publisher(OBSERVED)
        for reader in self.intake.readers:
            if not reader.raw:
                self.listen(reader.topic, reader.take, **reader.parts)
            elif record and alone and reader.topic is DIAGNOSTICS:
                self.here_in(reader.topic, reader.take, node_of_health)
            elif record:
                take = self._noting(reader.take) if reader.topic is STATE else reader.take
                self.stream_in(reader.topic, take, **reader.parts)
        self.every(0.1, on_progress)
        # The world begins when the report of the run is connected, not that of another host.
        if record:
            self.announce_when_connected()

    @property
    def recording(self) -> RunData:
        """What has been read."""
        return self.intake.recording

    @property
    def failures(self) -> list[dict[str, Any]]:
        """Nodes that failed."""
        return self.intake.failures

    @property
    def finished_ticks(self) -> int | None:
        """Ticks of the whole run, None as long as it goes on."""
        return self.intake.finished_ticks

    @property
    def tick(self) -> int:
        """Ticks seen so far."""
        return self.recording.ticks

    @property
    def complete(self) -> bool:
        """Whether the last tick of a finished run has been read in full."""
        ticks = self.finished_ticks
        return ticks is not None and self.recording.complete(ticks)

    def announce_failure(self, node: str, reason: str) -> None:
        """Tell the corridor that a node has gone."""
        stamp_ns = max(self.tick - 1, 0) * self._tick_ns
        message = failure(node, reason, "the launcher", stamp_ns)
        self.intake.take_failed(message)  # it may be the end of the run
        self._failed.publish(message)

    def _noting(self, take: Callable[[bytes], None]) -> Callable[[bytes], None]:
        """Reader of the truth that notes the wall time, and tells the world how far it has read."""
        intake, window = self.intake, OBSERVER_WINDOW_TICKS // 4

        def take_state(raw: bytes) -> None:
            now_s = self.steady_s()
            if math.isnan(intake.first_tick_s):
                intake.first_tick_s = now_s
            intake.last_tick_s = now_s
            take(raw)
            tick = self.tick - 1
            self.at_tick(max(tick, 0) * self._tick_ns)
            of_a_second = tick * self._tick_ns % NANOSECONDS < self._tick_ns
            if of_a_second and tick:
                self._publish_map(tick - 1)
            if tick % window == 0:
                header = Header()
                header.stamp.sec, header.stamp.nanosec = divmod(tick * self._tick_ns, 1_000_000_000)
                self._observed.publish(header)

        return take_state

    def _publish_map(self, tick: int) -> None:
        """Trains of a tick in the map; everything about the one before the present is in."""
        markers_wanted = bool(self._markers.get_subscription_count())
        poses_wanted = {
            key: publisher
            for key, publisher in self._poses.items()
            if publisher.get_subscription_count()
        }
        if not (markers_wanted or poses_wanted):
            return
        scene = self._scene(tick)
        if markers_wanted:
            self._markers.publish(train_markers(scene))
        for train in {train for train, _ in poses_wanted}:
            poses = map_poses(scene, scene.trains.index(train), self._locators)
            for source, pose in poses.items():
                if (train, source) in poses_wanted:
                    poses_wanted[train, source].publish(pose.to_msg())

    def _scene(self, tick: int) -> MapScene:
        recording = self.intake.recording

        def table(topic: Topic) -> FloatArray | None:
            if topic not in recording:
                return None
            return np.asarray(recording[topic].upto(tick + 1)[tick])

        return MapScene(
            tick * self._tick_ns, recording.trains, self._network, self._first_tracks, table
        )
