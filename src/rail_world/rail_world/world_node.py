"""The world: moves the trains, publishes the truth, and drives the ticks.

Topics out: ``/clock``, ``/world/state``, ``/world/<train>/odometry``, ``/world/<track>/path``,
``/world/markers``, ``/world/scenario``, ``/world/finished``, ``/<train>/odometer``. Topics in:
``<sink>/done``, ``/<train>/<supervision>/command``, ``/report/observed``, ``/ready``, ``/waiting``,
``/failed``.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import inf
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from std_msgs.msg import Header, String

from rail_msgs_py.failures import WATCH_PERIOD_S, FailureWatch, HeldUp
from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.position import Position, PositionWriter
from rail_msgs_py.stamps import NANOSECONDS, clock_from_cdr, clock_to_cdr, to_ns
from rail_msgs_py.table import values_from_cdr
from rail_msgs_py.tick_node import TickNode
from rail_msgs_py.topics.qos import OBSERVER_WINDOW_TICKS
from rail_msgs_py.topics.tick import (
    CLOCK,
    DONE,
    FAILED,
    FINISHED,
    NO_READER,
    OBSERVED,
    READY,
    WAITING,
)
from rail_msgs_py.topics.world import (
    COMMAND,
    CORRIDOR_MARKERS,
    CORRIDOR_PATH,
    ODOMETER,
    SCENARIO,
    STATE,
    TRUTH,
)
from rail_world.line.corridor_map import markers, path_of
from rail_world.trains.drive_command import DriveCommand
from rail_world.trains.judge import Judge
from rail_world.trains.odometers import Odometers
from rail_world.trains.traffic import Traffic

from .steps import Steps
from .world_file import WorldFile, read_world_file
from .world_parameters import WorldParameters

_NOT_RECEIVED = DriveCommand(emergency_brake=True)
_LEVELS = {
    "ok": DiagnosticStatus.OK,
    "warn": DiagnosticStatus.WARN,
    "error": DiagnosticStatus.ERROR,
}
#: Wall time of a tick that nobody answers any longer [s]: who comes back must be able to follow.
_UNANSWERED_S = 0.001


class WorldNode(TickNode[WorldParameters], name="world"):
    """The world as a node."""

    def setup(self) -> None:
        """Make the trains, and open the ports of all that ends a tick."""
        described = read_world_file(self._p.world_file)
        network = described.network()
        self._tick_ns = described.tick_ns
        #: The trains as they are: for judging alone.
        self.traffic = Traffic(described.trains, network, described.tick_s, described.conditions)
        self._judge = Judge(
            self.traffic,
            network,
            quiet_from_s=described.quiet_from_s,
            patience_s=self._p.patience_s,
            queue_m=self._p.queue_m,
        )
        self._tick = -1
        self._begun_s = self._started_s = self.steady_s()
        self._sign_s: float | None = None
        self._observed_ns = 0
        self._missing = {*self._p.nodes, self.get_fully_qualified_name()}
        self._waiting: dict[str, tuple[tuple[str, str], ...]] = {}
        self._absent: set[str] = set()
        #: Whether the run has come to its end.
        self.finished = False
        #: How far it may run; freely, unless it is stepped.
        self.steps = Steps(self._next_tick)
        names = self.traffic.names
        self._clock_publisher = self.publisher(CLOCK)
        self._begin_tick = self._clock_publisher.send
        self._state = self.table_out(STATE, names)
        self._truth = [self.publisher(TRUTH, train=name).send for name in names]
        self._truth_writers: dict[tuple[str, str], PositionWriter] = {}
        self._finish = self.publisher(FINISHED)
        self._supervisors = {
            train: COMMAND.owner(train=train, supervision=self._p.supervision)
            for train in self._p.supervised
        }
        self._odometers = {
            train: self.table_out(ODOMETER, (train,), awaited=True, train=train)
            for train in self._p.odometers
        }
        self._counted = Odometers(
            described.seed,
            described.odometer_error,
            self._p.odometers,
            described.trains,
            described.slips,
        )
        # Until its first command a train stands: what is not received is not permitted.
        self._commands = dict.fromkeys(self._p.supervised, _NOT_RECEIVED)
        ports = (*self._p.sinks, *self._supervisors.values())
        self._inbox: TickInbox[DriveCommand | None] = TickInbox(ports)
        self._watch = FailureWatch(self, {port: port for port in ports}, self._drop_sinks)
        for train, port in self._supervisors.items():
            self.stream_in(
                COMMAND,
                partial(self._on_command, port),
                train=train,
                supervision=self._p.supervision,
            )
        for sink in self._p.sinks:
            self.stream_in(DONE, partial(self._on_done, sink), node=sink)
        if self._p.observed:
            self.listen(OBSERVED, self._on_observed)
        self.listen(READY, self._on_ready)
        self.listen(WAITING, self._on_waiting)
        self.listen(FAILED, self._on_failed_before_start)
        for name, track in network.tracks.items():
            self.publisher(CORRIDOR_PATH, track=name).publish(path_of(track))
        self.publisher(CORRIDOR_MARKERS).publish(markers(described.drawing, network))
        self.publisher(SCENARIO).publish(String(data=described.scenario))
        self._pace: Any = None
        self._held_up = HeldUp(WATCH_PERIOD_S)
        self._watch_timer = self.every(WATCH_PERIOD_S, self._check)
        self.await_connection(
            lambda: self._clock_publisher.get_subscription_count() >= self._p.clock_readers,
            CLOCK.name(),
            NO_READER,
        )

    # Before the first tick ---------------------------------------------------------------

    def _on_ready(self, message: Any) -> None:
        self._sign_s = self.steady_s()
        self._missing.discard(message.data)
        self._start_if_ready()

    def _on_waiting(self, message: Any) -> None:
        self._sign_s = self.steady_s()
        self._waiting[message.name] = tuple((pair.key, pair.value) for pair in message.values)

    def _on_failed_before_start(self, message: Any) -> None:
        if self._tick < 0:
            self._absent.add(message.name)
            self._missing.discard(message.name)
            self._start_if_ready()

    def _start_if_ready(self) -> None:
        if self._tick < 0 and not self._missing:
            self._start()

    def _start(self) -> None:
        self._started_s = self.steady_s()
        self._next_tick()

    def _wait_for_the_start(self, now_s: float) -> None:
        """Begin without those that have failed, once all others have what is left to connect to.

        The wait begins when this node is spun, and again with every sign of another.
        """
        if self._sign_s is None:
            self._sign_s = now_s
        itself = self.get_fully_qualified_name()
        if itself in self._missing:
            self._waiting[itself] = tuple((one.topic, one.lacks) for one in self.lacking())
        silent = self._missing - self._waiting.keys()
        if self._absent and not silent and all(map(self._nobody_left, self._missing)):
            self._start()
        elif now_s - self._sign_s > self._p.start_timeout_s:
            self._sign_s = now_s
            if silent:
                self._watch.name(sorted(silent), self._p.start_timeout_s)
                self._absent |= silent
                self._missing -= silent
                return
            for node in sorted(self._missing):
                topics = ", ".join(sorted({topic for topic, _ in self._waiting[node]}))
                text = f"begins although {node} waits for {topics}"
                self.report(DiagnosticStatus.WARN, f"start of {node}", text)
            self._start()

    def _nobody_left(self, node: str) -> bool:
        """Whether what a node waits for can only have been of those that have failed."""
        for topic, lacks in self._waiting[node]:
            if topic == CLOCK.name() and node == self.get_fully_qualified_name():
                connected = self._clock_publisher.get_subscription_count()
                left = self.count_subscribers(topic) - connected
            elif lacks == NO_READER:
                left = self.count_subscribers(topic)
            else:
                left = self.count_publishers(topic)
            if left > 0:
                return False
        return True

    def take_faults(self, world: WorldFile) -> None:
        """Go on with other faults of trains, all else being as it was."""
        self.traffic.conditions = world.conditions
        self._judge.quiet_from_s = world.quiet_from_s
        self._counted.slip(world.slips)

    @property
    def ticks(self) -> int:
        """Ticks begun so far."""
        return self._tick + 1

    @property
    def missing(self) -> tuple[str, ...]:
        """Who is waited for: before the first tick nodes, later what ends a tick."""
        return tuple(self._missing) if self._tick < 0 else tuple(self._inbox.missing)

    # Ticks -------------------------------------------------------------------------------

    def _next_tick(self) -> None:
        if self.finished:
            self.steps.stand()
            return
        arrived = self._p.end_when_arrived and self._tick >= 0 and self.traffic.all_arrived
        if arrived or (self._p.ticks and self._tick + 1 >= self._p.ticks):
            self._end()
            self.steps.stand()
            return
        if self.steps.over(self.ticks):
            return
        self._tick += 1
        if self._tick > 0:
            self.traffic.step(self._commands)
        stamp_ns = self._tick * self._tick_ns
        self._begun_s = self.steady_s()
        state = self.traffic.state()
        self._state(stamp_ns, state)
        if stamp_ns % NANOSECONDS < self._tick_ns:
            self._publish_truth(stamp_ns)
        self._publish_odometers(stamp_ns)
        self.at_tick(stamp_ns)
        for event in self._judge.judge(1e-9 * stamp_ns, self._commands):
            level = _LEVELS[event.level]
            self.report(level, event.subject, event.message, event.values, stamp_ns)
        self._begin_tick(clock_to_cdr(stamp_ns))
        if not self._inbox.awaits_anything:
            self._tick_over()

    def _publish_odometers(self, stamp_ns: int) -> None:
        if not self._odometers:
            return
        for train, values in self._counted.count(1e-9 * stamp_ns, self.traffic.travelled()):
            self._odometers[train](stamp_ns, values)

    def _publish_truth(self, stamp_ns: int) -> None:
        for publish, (name, track, chainage_m, speed_mps) in zip(
            self._truth, self.traffic.places(), strict=True
        ):
            key = (name, track)
            if key not in self._truth_writers:
                self._truth_writers[key] = PositionWriter(name, track)
            position = Position(stamp_ns, name, track, chainage_m, 0.0, speed_mps, 0.0)
            publish(self._truth_writers[key].write(position))

    def _on_done(self, sink: str, raw: bytes) -> None:
        if (stamp_ns := clock_from_cdr(raw)) <= self._tick * self._tick_ns:  # has it begun?
            self._inbox.put(stamp_ns, sink, None)
            self._advance()

    def _on_command(self, port: str, raw: bytes) -> None:
        stamp_ns, values = values_from_cdr(raw, 1, len(COMMAND.columns))
        permitted_mps, _, *demands = values[0].tolist()
        heeded_mps = permitted_mps if self._p.cab_signals else inf
        command = DriveCommand(heeded_mps, *(demand > 0.0 for demand in demands))
        self._inbox.put(stamp_ns, port, command)
        self._advance()

    def _advance(self) -> None:
        while self._inbox.complete:
            stamp_ns, items = self._inbox.take()
            if stamp_ns == self._tick * self._tick_ns:
                self._obey(items)
                self._tick_over()

    def _obey(self, items: Mapping[str, DriveCommand | None]) -> None:
        """Take the commands of a tick; a train whose supervision is silent brakes."""
        for train, port in self._supervisors.items():
            self._commands[train] = items.get(port) or _NOT_RECEIVED

    def _tick_over(self) -> None:
        self._begun_s = float("inf")
        self._inbox.close(self._tick * self._tick_ns)
        wait_s = max(self._wait_s(), 0.0 if self._inbox.awaits_anything else _UNANSWERED_S)
        if wait_s <= 0.0:
            self._next_tick()
            return
        if self._pace is None:
            self._pace = self.every(wait_s, self._on_pace)
        else:
            self._pace.timer_period_ns = int(wait_s * NANOSECONDS)
            self._pace.reset()

    def _on_pace(self) -> None:
        self._pace.cancel()
        if self._wait_s() > 1e-4:
            self._tick_over()
        else:
            self._next_tick()

    def _wait_s(self) -> float:
        """Wall time until the next tick may start."""
        wait_s = 0.0
        if self._p.rate > 0.0:
            due_s = self._started_s + (self._tick + 1) * self._tick_ns * 1e-9 / self._p.rate
            wait_s = due_s - self.steady_s()
        ahead = (self._tick + 1) * self._tick_ns - self._observed_ns
        if self._p.observed and ahead > OBSERVER_WINDOW_TICKS * self._tick_ns:
            wait_s = max(wait_s, 0.005)
        return wait_s

    def _on_observed(self, message: Any) -> None:
        self._observed_ns = to_ns(message.stamp)

    def _end(self) -> None:
        self.finished = True
        self._watch_timer.cancel()
        header = Header(frame_id="world")
        header.stamp.sec, header.stamp.nanosec = divmod(self._tick * self._tick_ns, NANOSECONDS)
        self._finish.publish(header)

    # Failures ----------------------------------------------------------------------------

    def _check(self) -> None:
        now_s = self.steady_s()
        self._begun_s += self._held_up.look(now_s)
        if self._tick < 0:
            if not self.steps.standing:
                self._wait_for_the_start(now_s)
            return
        if now_s - self._begun_s > self._p.timeout_s:
            # Nothing of the tick may have come, so the inbox cannot tell the stamp by itself.
            stamp_ns = self._tick * self._tick_ns
            missing = self._inbox.missing
            self._watch.give_up(missing, self._p.timeout_s, stamp_ns)
            self.report(
                DiagnosticStatus.ERROR,
                "tick",
                f"no answer from {', '.join(missing)}",
                stamp_ns=stamp_ns,
            )

    def _drop_sinks(self, sinks: tuple[str, ...]) -> None:
        self._inbox.drop(sinks)
        if self._tick < 0 or self._begun_s == float("inf"):
            return
        tick = self._tick
        self._advance()
        under_way = self._tick == tick and self._begun_s != float("inf")
        if under_way and not self._inbox.awaits_anything:
            self._obey({})
            self._tick_over()


if __name__ == "__main__":
    WorldNode.main()
