"""The floor of transport: the messages of a tick through the same executor, and no arithmetic."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

from rail_msgs_py.topics.ranging import RANGE, VRS_RX, VRS_TX, WRS_RX, WRS_TX
from rail_msgs_py.topics.tick import CLOCK, DONE
from rail_msgs_py.topics.topic import Topic

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from rail_corridor.middleware.discovery import discover_on
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.ranging.range_reading import RangeWriter
from rail_msgs_py.stamps import clock_to_cdr
from rail_msgs_py.waveform import Waveform, silence


class _Barrier:
    """Calls ``then`` each time ``count`` messages have come."""

    def __init__(self, count: int, then: Callable[[], None]) -> None:
        self._count, self._then, self._seen = count, then, 0

    def __call__(self, raw: bytes) -> None:
        self._seen += 1
        if self._seen == self._count:
            self._seen = 0
            self._then()


def transport_ms(
    zones: int, trains: int, channels: int, heard: int, samples: int, ticks: int
) -> float:
    """Wall time of a tick's messages [ms].

    Parameters
    ----------
    zones, trains, channels : int
        Antennas at the wayside, trains, downlink channels.
    heard : int
        Blocks that are not silent among those a train receives in a tick; as many are
        received at the wayside as there are trains.
    samples : int
        Samples of a block.
    ticks : int
        Ticks to measure.
    """
    import rclpy
    from rclpy.experimental.events_executor import EventsExecutor
    from rclpy.signals import SignalHandlerOptions
    from rclpy.task import Future

    discover_on("this")
    context = rclpy.Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)

    def node(name: str) -> Any:
        return rclpy.create_node(
            name, context=context, start_parameter_services=False, enable_rosout=False
        )

    block = Waveform(0, 4e6, 2.4e9, 1, np.ones((1, samples), dtype=np.complex128)).to_cdr()
    quiet = silence(0, 4e6, 2.4e9, 1).to_cdr()
    clock, done, reading = (
        clock_to_cdr(0),
        header_to_cdr(0),
        RangeWriter("z", 0.0, 1.0).write(0, 1.0, 1.0),
    )
    world, medium, controller = node("bench_world"), node("bench_medium"), node("bench_controller")
    nodes = [world, medium, controller]
    finished = Future()
    count = 0

    def out(owner: Any, topic: Topic, name: str) -> Callable[[bytes], None]:
        publish: Callable[[bytes], None] = owner.create_publisher(
            topic.type, f"/bench{name}", topic.qos
        ).handle.publish_raw
        return publish

    def listen(owner: Any, topic: Topic, name: str, callback: Any) -> None:
        owner.create_subscription(topic.type, f"/bench{name}", callback, topic.qos, raw=True)

    tick = out(world, CLOCK, "/clock")
    to_trains = [out(medium, VRS_RX, f"/t{i}/c{c}") for i in range(trains) for c in range(channels)]
    to_zones = [out(medium, WRS_RX, f"/z{i}/rx") for i in range(zones)]

    def downlink() -> None:
        for index, publish in enumerate(to_trains):
            publish(block if index % channels < heard else quiet)

    def uplink() -> None:
        for index, publish in enumerate(to_zones):
            publish(block if index < trains else quiet)

    from_zones, from_trains = _Barrier(zones, downlink), _Barrier(trains, uplink)
    for i in range(zones):
        station = node(f"bench_z{i}")
        nodes.append(station)
        send, tell = out(station, WRS_TX, f"/z{i}/tx"), out(station, RANGE, f"/r{i}")
        listen(station, CLOCK, "/clock", lambda _, send=send: send(block))
        listen(station, WRS_RX, f"/z{i}/rx", lambda _, tell=tell: tell(reading))
        listen(medium, WRS_TX, f"/z{i}/tx", from_zones)
    for i in range(trains):
        vehicle = node(f"bench_t{i}")
        nodes.append(vehicle)
        send = out(vehicle, VRS_TX, f"/t{i}/tx")
        answer = _Barrier(channels, lambda send=send: send(block))
        for c in range(channels):
            listen(vehicle, VRS_RX, f"/t{i}/c{c}", answer)
        listen(medium, VRS_TX, f"/t{i}/tx", from_trains)
    over = out(controller, DONE, "/done")
    readings = _Barrier(zones, lambda: over(done))
    for i in range(zones):
        listen(controller, RANGE, f"/r{i}", readings)

    def next_tick(_: bytes) -> None:
        nonlocal count
        count += 1
        if count < ticks:
            tick(clock)
        else:
            finished.set_result(None)

    listen(world, DONE, "/done", next_tick)
    executor = EventsExecutor(context=context)
    for each in nodes:
        executor.add_node(each)
    begin = time.perf_counter()
    tick(clock)
    executor.spin_until_future_complete(finished, timeout_sec=600.0)
    wall_s = time.perf_counter() - begin
    executor.shutdown()
    for each in nodes:
        each.destroy_node()
    rclpy.try_shutdown(context=context)
    return wall_s / ticks * 1e3
