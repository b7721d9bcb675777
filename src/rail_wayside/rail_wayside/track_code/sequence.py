"""Trains do not vanish: what came into a circuit from the one behind is held until it went on.

Rust or leaves between wheel and rail can keep axles from shunting the rails, and the receiver of
the circuit then says "clear" over a train. A circuit that a train entered in sequence - the one
behind was occupied, the level went down as by axles - *holds* it. When its receiver says "clear",
it stays occupied unless

- the circuit ahead holds the train now;
- or the circuit behind has been detected as occupied all the time, and still is
  `LEAST_BEHIND_S` after the receiver says "clear": the train never left it;
- or a circuit farther ahead became occupied by what did not come from the one before it, and all
  between are clear: the train that was lost is there.

Where the line can be left, and past its last circuit, there is no circuit ahead to hold anything.
A circuit that is switched on holds nothing, and knows of none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

#: A train that enters has been in the circuit behind for that long [s]: faults that befall two
#: circuits at once, such as rain, are no train.
LEAST_BEHIND_S: Final = 1.0


@dataclass(frozen=True)
class CircuitState:
    """What a circuit says of itself: occupied at all, by its receiver, and whether it holds."""

    occupied: bool
    detected: bool
    holds: bool


class SequenceHold:
    """Holds a train in one circuit.

    Parameters
    ----------
    tick_s : float
    leaves : bool
        Whether trains can leave the line here.
    """

    def __init__(self, tick_s: float, *, leaves: bool = False) -> None:
        self._tick_s, self._leaves = tick_s, leaves
        self._holds = False
        self._detected = True  # not known is occupied
        self._in_sequence = False  # whether the present occupation came from behind
        self._behind_stays = False
        self._undetected_s = 0.0  # for how long the receiver has said "clear"
        self._behind_s = 0.0  # for how long the circuit behind has been occupied
        self._ahead: list[bool | None] = []
        self._reappeared = False

    def update(
        self,
        *,
        detected: bool,
        shunted: bool,
        behind: CircuitState | None,
        ahead: Sequence[CircuitState | None],
    ) -> CircuitState:
        """One tick.

        Parameters
        ----------
        detected, shunted : bool
            By the receiver of the circuit, see `Detection`.
        behind : CircuitState, optional
            Of the circuit behind; None = there is none, or nothing is known of it.
        ahead : sequence of CircuitState or None
            Of the circuits ahead, the nearest first.
        """
        self._look_ahead([None if each is None else each.occupied for each in ahead])
        if detected and not self._detected:
            self._in_sequence = self._behind_s >= LEAST_BEHIND_S - 1e-9
            self._behind_stays = True
        self._behind_stays &= behind is not None and behind.detected
        occupied_behind = behind is not None and behind.occupied
        self._behind_s = self._behind_s + self._tick_s if occupied_behind else 0.0
        if detected and self._in_sequence and shunted and not self._holds:
            self._holds, self._reappeared = True, False
        if not detected:
            gone_on = bool(ahead) and ahead[0] is not None and ahead[0].holds
            nowhere = self._leaves or not ahead
            self._undetected_s += self._tick_s
            # Axles that fail to shunt do so in both circuits that a train is in.
            stayed = self._behind_stays and self._undetected_s > LEAST_BEHIND_S + 2 * self._tick_s
            if nowhere or gone_on or stayed or self._reappeared:
                self._holds = False
            self._in_sequence = False
        else:
            self._undetected_s = 0.0
        self._detected = detected
        return CircuitState(detected or self._holds, detected, self._holds)

    def _look_ahead(self, occupied: list[bool | None]) -> None:
        """Notice a train that is somewhere without having come there."""
        before = self._ahead
        self._ahead = occupied
        if not self._holds or len(before) != len(occupied) or True in occupied[:1]:
            return
        for index in range(1, len(occupied)):
            if occupied[index]:
                self._reappeared |= before[index] is False
                return
