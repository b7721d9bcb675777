"""A world that is stepped: it runs so many ticks, and stands until it may run more."""

from __future__ import annotations

from collections.abc import Callable


class Steps:
    """How far a world may run.

    It runs freely until `run_until` is called for the first time. While it stands no wall time is
    running for a tick, so that it may stand for as long as anybody likes.

    Parameters
    ----------
    go_on : callable
        Begins the next tick, or asks `over` and stands.
    """

    def __init__(self, go_on: Callable[[], None]) -> None:
        self._go_on = go_on
        self._most: int | None = None
        self._told: Callable[[], None] | None = None
        #: Whether it stands.
        self.standing = False

    def run_until(self, ticks: int, when_standing: Callable[[], None]) -> None:
        """Begin no tick beyond so many; call back when the last is over, or the run is."""
        self._most, self._told = ticks, when_standing
        if self.standing:
            self.standing = False
            self._go_on()

    def over(self, ticks: int) -> bool:
        """Whether the tick after so many has to wait; then the world stands."""
        if self._most is None or ticks < self._most:
            return False
        self.stand()
        return True

    def stand(self) -> None:
        """Stand, and tell who has asked for it."""
        if self._most is None:
            return
        self.standing = True
        told, self._told = self._told, None
        if told is not None:
            told()
