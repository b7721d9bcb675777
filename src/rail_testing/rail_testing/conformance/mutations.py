"""What can happen to messages on their way: empty, unreadable, old, twice, out of order."""

from __future__ import annotations

import array
from collections import deque
from collections.abc import Callable
from copy import deepcopy
from math import inf, nan
from typing import Any

import numpy as np

from rail_msgs_py.position import Position
from rail_msgs_py.ranging.range_reading import RangeReading
from rail_msgs_py.stamps import seconds_to_ns
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.train_radio.telegrams import Telegrams
from rail_msgs_py.waveform import HEADER_VALUES, Waveform

Mutation = Callable[[Any], Any]
#: By so much time jumps back [s].
_BACK_S = 5.0


def repeated(topic: Topic) -> Mutation:
    """Each message comes twice."""
    return lambda message: [message, deepcopy(message)]


def out_of_order(topic: Topic) -> Mutation:
    """The message of the tick before comes again after that of the tick."""
    before: deque[Any] = deque(maxlen=2)

    def change(message: Any) -> Any:
        before.append(deepcopy(message))
        return [message, before[0]] if len(before) == 2 else message

    return change


def stale(topic: Topic) -> Mutation:
    """One that is eight ticks old comes before that of the tick."""
    before: deque[Any] = deque(maxlen=9)

    def change(message: Any) -> Any:
        before.append(deepcopy(message))
        return [before[0], message] if len(before) == 9 else message

    return change


def time_back(topic: Topic) -> Mutation:
    """After that of the tick comes one whose clock has jumped back."""

    def change(message: Any) -> Any:
        old = deepcopy(message)
        if topic.view is Telegrams:
            view = Telegrams.from_msg(old)
            back_ns = max(0, view.stamp_ns - seconds_to_ns(_BACK_S))
            return [message, Telegrams(back_ns, view.frames).to_msg()]
        if hasattr(old, "header"):
            old.header.stamp.sec = max(0, int(old.header.stamp.sec - _BACK_S))
        else:
            data = old.data
            data[0] = max(0.0, data[0] - _BACK_S)
            old.data = data
        return [message, old]

    return change


#: Nothing may come of these.
DISORDERS: dict[str, Callable[[Topic], Mutation]] = {
    "repeated": repeated,
    "out of order": out_of_order,
    "stale": stale,
    "time jumps back": time_back,
}


def empty(topic: Topic) -> Mutation:
    """Nothing is in it: a waveform without samples, no telegram, no range, a table of NaN."""

    def change(message: Any) -> Any:
        if topic.view is Waveform:
            view = Waveform.from_msg(message)
            none = np.zeros((1, 0), dtype=np.complex128)
            head = (view.stamp_ns, view.sample_rate_hz, view.carrier_hz, view.channel)
            return Waveform(*head, none).to_msg()
        if topic.view is Telegrams:
            return Telegrams(Telegrams.from_msg(message).stamp_ns, ()).to_msg()
        if topic.view is RangeReading:
            message.range = inf
            return message
        if topic.view is Position:
            message.pose.covariance[0] = inf
            return message
        return no_numbers(topic)(message)

    return change


def no_numbers(topic: Topic) -> Mutation:
    """What should be numbers are none; telegrams are bits at random."""

    def change(message: Any) -> Any:
        if topic.view is Telegrams:
            return garbled(topic)(message)
        if topic.view is RangeReading:
            message.range = nan
            return message
        if topic.view is Position:
            message.pose.pose.position.x = nan
            return message
        head = HEADER_VALUES if topic.view is Waveform else 1
        data = np.array(message.data)
        data[head:] = nan
        message.data = array.array("d", data.tobytes())
        return message

    return change


def garbled(topic: Topic) -> Mutation:
    """What comes through the air is noise: of the same power, or of flipped bits."""
    generator = np.random.default_rng(1)

    def change(message: Any) -> Any:
        if topic.view is Telegrams:
            view = Telegrams.from_msg(message)
            frames = tuple((slot, generator.bytes(len(frame))) for slot, frame in view.frames)
            return Telegrams(view.stamp_ns, frames).to_msg()
        if topic.view is Waveform and len(message.data) > HEADER_VALUES:
            data = np.array(message.data)
            power = float(np.sqrt(np.mean(data[HEADER_VALUES:] ** 2)))
            data[HEADER_VALUES:] = power * generator.standard_normal(data.size - HEADER_VALUES)
            message.data = array.array("d", data.tobytes())
        return message

    return change


#: From these nothing can be learnt.
GARBAGE: dict[str, Callable[[Topic], Mutation]] = {
    "empty": empty,
    "no numbers": no_numbers,
    "garbled": garbled,
}
