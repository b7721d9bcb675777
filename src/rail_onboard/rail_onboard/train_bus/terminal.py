"""A terminal at one end of the train bus: what it says in a tick, and what it makes of an answer.

Both ends say one message in each tick. The head's of tick k is answered in the tail's of tick
k + 1, so that in health the end of the train is confirmed as it was a tick ago.
"""

from __future__ import annotations

from math import inf, log10, nan

from rail_signals.train_bus.receiver import ReceivedFrame

from .message import BusMessage, End, pattern_errors

OTHER: dict[End, End] = {"head": "tail", "tail": "head"}


class BusTerminal:
    """Counts what comes through.

    Parameters
    ----------
    end
        Which end it is.
    tick_s
        Time of a tick [s].
    timeout_s
        Age at which the last word of the other end counts no more [s].
    """

    def __init__(self, end: End, tick_s: float, timeout_s: float) -> None:
        self._end, self._tick_s, self._timeout_s = end, tick_s, timeout_s
        self.sent = self.received = self.lost = 0
        self._bits = self._bit_errors = 0
        self._ebn0_db = nan
        self._received_tick: int | None = None
        self._confirmed: int | None = None
        self._last_loss: int | None = None

    def payload(self, tick: int) -> bytes:
        """What to say in a tick."""
        self.sent += 1
        return BusMessage(self._end, tick, self._received_tick, self.lost).to_bytes()

    def take(self, tick: int, frame: ReceivedFrame) -> None:
        """Take what was received in a tick; what is no message of this tick is one lost."""
        self._ebn0_db = 10.0 * log10(frame.ebn0) if frame.ebn0 > 0.0 else nan
        if frame.detected:
            wrong, known = pattern_errors(frame.bits)
            self._bit_errors += wrong
            self._bits += known
        message = self._read(frame.payload)
        if message is None or message.end != OTHER[self._end] or message.tick != tick:
            self.lost += 1
            self._last_loss = tick
            return
        self.received += 1
        self._received_tick = tick
        # The tail shows that it is there by speaking, and the head that it was heard.
        self._confirmed = message.received_tick if self._end == "head" else tick

    def age_s(self, tick: int) -> float:
        """How old the last word of the other end is [s]; infinite before the first."""
        return inf if self._confirmed is None else (tick - self._confirmed) * self._tick_s

    def is_confirmed(self, tick: int) -> bool:
        """Whether the other end is known to be there."""
        return self.age_s(tick) <= self._timeout_s

    def loses(self, tick: int) -> bool:
        """Whether a message was lost not long ago."""
        if self._last_loss is None:
            return False
        return (tick - self._last_loss) * self._tick_s <= self._timeout_s

    def link_values(self, tick: int) -> tuple[float, ...]:
        """Values as ``rail_msgs_py.topics.train_bus.BUS_LINK.columns``."""
        counts = (self.sent, self.received, self.lost, self._bits, self._bit_errors)
        return (
            *map(float, counts),
            self._ebn0_db,
            float(self.is_confirmed(tick)),
            self.age_s(tick),
        )

    @staticmethod
    def _read(payload: bytes | None) -> BusMessage | None:
        if payload is None:
            return None
        try:
            return BusMessage.from_bytes(payload)
        except ValueError:
            return None
