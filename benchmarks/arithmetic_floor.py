"""The floor of arithmetic: what the nodes of a corridor compute in a tick, and no transport."""

from __future__ import annotations

import time

import numpy as np

from rail_corridor.plan.plan import Plan
from rail_corridor.scenario.model import Scenario
from rail_onboard.ranging.channel_selector import ChannelSelector
from rail_signals.ranging.receiver import FmToneReceiver
from rail_signals.ranging.signal import modulate
from rail_signals.ranging.transponder import reply_lag_rad
from rail_wayside.ranging.ranging_station import RangingStation
from rail_wayside.ranging.train_tracker import ZoneReading, ZoneTracker
from rail_wayside.zone_controller_node import ZoneControllerParameters, zone_map_of
from rail_world.ranging.description import RadioDescription
from rail_world.ranging.medium import RadioMedium
from rail_world.ranging.medium_node import antennas_of
from rail_world.trains.traffic import Traffic


def arithmetic_ms(scenario: Scenario, plan: Plan, ticks: int) -> float:
    """Wall time that the arithmetic of a tick takes [ms]."""
    world = plan.world
    traffic = Traffic(world.trains, world.network(), world.tick_s)
    radio = world.part("ranging", RadioDescription)
    medium = RadioMedium(radio, world.seed)
    signal = scenario.ranging.signal
    receiver = FmToneReceiver(signal)
    station = RangingStation(signal, scenario.ranging.comparator, scenario.transponder.delay_s)
    pairs = {a.downlink_channel: a.uplink_channel for a in radio.stations}
    selectors = [ChannelSelector(pairs) for _ in world.trains]
    controller = next(spec for spec in plan.nodes if spec.kind == "zone_controller")
    known = ZoneControllerParameters(**controller.parameters)
    tracker = ZoneTracker(
        zone_map_of(known), list(zip(known.trains, known.entry_zones, strict=True))
    )
    wave = modulate(signal, np.zeros(len(signal.tones_hz))) * 0.3
    sent = {index: wave for index in range(len(radio.stations))}
    begin = time.perf_counter()
    for tick in range(ticks):
        time_s = tick * world.tick_s
        if tick:
            traffic.step()
        paths = medium.paths(antennas_of(traffic.state()))
        heard = medium.downlink(tick, time_s, paths, sent)
        replies = {}
        for train, selector in enumerate(selectors):
            bursts = {c: r.samples for (t, c), r in heard.items() if t == train}
            if not bursts:
                continue
            found = receiver.estimate(np.stack(list(bursts.values())))
            rows = {c: row for row, c in enumerate(bursts) if found.detected[row]}
            levels = {c: 20.0 * float(np.log10(found.amplitude[row])) for c, row in rows.items()}
            channel = selector.update(levels)
            if channel in rows:
                lag = reply_lag_rad(found.phase_lag_rad[rows[channel]], signal, 1e-6)
                replies[train] = (pairs[channel], modulate(signal, lag) * 0.3)
        returned = medium.uplink(tick, time_s, paths, replies)
        readings = {a.zone: ZoneReading(np.inf, np.inf) for a in radio.stations}
        for (index, _), reception in returned.items():
            reading = station.read(reception.samples)
            readings[radio.stations[index].zone] = ZoneReading(reading.range_m, reading.variance_m2)
        tracker.update(time_s, readings)
    return (time.perf_counter() - begin) / ticks * 1e3
