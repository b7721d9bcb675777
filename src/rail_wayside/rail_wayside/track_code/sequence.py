"""Trains do not vanish: what came into a circuit from the one behind is held until it went on.

Rust or leaves between wheel and rail can keep axles from shunting the rails, and the receiver of
the circuit then says "clear" over a train. A circuit therefore *holds* a train that came in from a
circuit that held it, or that is *missing* behind; what has shunted a circuit since it was
switched on is a train too. Nothing else comes in: what occupies a circuit although no train was
behind is a fault of the circuit, and so is what occupies the next one after it.

A circuit lets go of its train only where all of it is seen to be elsewhere. The axles of a train
shunt in every circuit that it is in, or in none: if a circuit ahead that it reached in sequence is
shunted while the one before that says "clear", both for `PROVEN_S`, no axle is farther behind. So

- a circuit ahead proves that the train went on, be the own receiver as dead as it may;
- or the circuit behind was occupied all the time, and still is `LEAST_BEHIND_S` after the receiver
  says "clear": the train never left it;
- or the train was found: a circuit ahead with a train missing behind, and none between, has been
  shunted for `PROVEN_S`. It says so backwards, from circuit to circuit, to the first that holds;
- or the circuit ahead, that held the same train, lets go of it.

Where the line can be left, and past its last circuit, there is no circuit ahead to hold anything.
A circuit that is switched on knows of nothing before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

#: A train that enters has been in the circuit behind for that long [s]: faults that befall two
#: circuits at once, such as rain, are no train.
LEAST_BEHIND_S: Final = 1.0
#: Two receivers agree for that long, and two ticks, that a train is in one and not in the other
#: [s]: longer than one needs more than the other to notice the same change.
PROVEN_S: Final = 0.5
#: A circuit that was not heard is believed to be occupied after that long only [s]: one that was
#: switched on says so until it has picked up.
HEARD_AGAIN_S: Final = 3.0


@dataclass(frozen=True)
class CircuitState:
    """What a circuit says of itself.

    ``occupied`` at all, ``detected`` and ``shunted`` by its receiver, whether it ``holds`` a train;
    ``missing``: a train is held here or behind, and no receiver sees one from there to here;
    ``found``: the train that is missing behind is ahead.
    """

    occupied: bool
    detected: bool
    holds: bool
    shunted: bool = False
    missing: bool = False
    found: bool = False


class SequenceHold:
    """Holds a train in one circuit.

    Parameters
    ----------
    tick_s : float
    leaves : bool
        Whether trains can leave the line here.
    first : bool
        Whether the line begins here: nothing comes from behind.
    """

    def __init__(self, tick_s: float, *, leaves: bool = False, first: bool = False) -> None:
        self._tick_s, self._leaves, self._first = tick_s, leaves, first
        self._holds = True  # what is there when switched on may be a train
        self._unproven = True  # that there is one: nothing shunted since
        self._detected = True  # not known is occupied
        self._lost = False  # whether the train was missing when it came in
        self._told = False  # that the train missing behind is ahead; to be passed on
        self._behind_stays = False
        self._undetected_s = 0.0  # for how long the receiver has said "clear"
        self._behind_s = 0.0  # for how long a train has been behind
        self._shunted_s = 0.0
        self._ahead: list[CircuitState | None] = []
        self._heard_s: list[float] = []  # for how long each circuit ahead has been heard
        self._entered: list[bool] = []  # the train may be so far; whether it was seen to come in
        self._proven_s: list[float] = []

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
        missing = not self._first and (behind is None or behind.missing)
        came = detected and not self._detected
        was_behind = self._behind_s >= LEAST_BEHIND_S - 1e-9
        # A train that is missing may have come in while the receiver was dead, too.
        if detected and not self._holds and was_behind and (came or missing):
            self._holds, self._lost = True, came and missing
        self._behind_stays |= came
        self._behind_stays &= behind is not None and behind.detected
        train_behind = missing or (behind is not None and behind.holds)
        self._behind_s = self._behind_s + self._tick_s if train_behind else 0.0
        self._shunted_s = self._shunted_s + self._tick_s if detected and shunted else 0.0
        self._unproven &= self._shunted_s < self._long_s
        self._undetected_s = 0.0 if detected else self._undetected_s + self._tick_s
        self._follow(ahead)
        next_state = ahead[0] if ahead else None
        self._told |= next_state is not None and next_state.found
        self._told &= not detected or self._unproven  # no train between
        seen_ahead = self._went_on(detected, ahead) or (not detected and self._passed(ahead))
        found = self._lost and (seen_ahead or self._shunted_s >= self._long_s)
        if self._holds and (seen_ahead or (not detected and self._nothing_there(ahead))):
            # What was missing behind when it came is what is held there, too.
            self._told &= self._unproven or self._lost
            self._holds = self._unproven = False
        told = found or (self._told and not detected)
        if behind is not None:
            self._lost &= self._holds and not found
            self._told &= not told
        self._detected = detected
        self._ahead = list(ahead)
        return CircuitState(
            detected or self._holds,
            detected,
            self._holds,
            shunted,
            not detected and (self._holds or missing),
            told,
        )

    @property
    def _long_s(self) -> float:
        return PROVEN_S + 2.0 * self._tick_s - 1e-9

    def _passed(self, ahead: Sequence[CircuitState | None]) -> bool:
        """Whether the circuit ahead has just let go of the train that is held here."""
        before = self._ahead[0] if self._ahead else None
        now = ahead[0] if ahead else None
        held = bool(self._entered) and before is not None and before.holds
        return self._told or (held and now is not None and not now.occupied)

    def _nothing_there(self, ahead: Sequence[CircuitState | None]) -> bool:
        """Whether what has become clear held no train, or nothing could hold it any more."""
        # Axles that fail to shunt do so in both circuits that a train is in.
        stayed = self._undetected_s > LEAST_BEHIND_S + 2.0 * self._tick_s
        return self._unproven or self._leaves or not ahead or (self._behind_stays and stayed)

    def _follow(self, ahead: Sequence[CircuitState | None]) -> None:
        """Note how far the train may have come, and for how long each circuit has been heard."""
        if len(self._ahead) != len(ahead):
            self._ahead = [None] * len(ahead)
            self._heard_s = [0.0] * len(ahead)
        for index, state in enumerate(ahead):
            self._heard_s[index] = self._heard_s[index] + self._tick_s if state else 0.0
        if not self._holds:
            self._entered, self._proven_s = [], []
            return
        while len(self._entered) < len(ahead):
            index = len(self._entered)
            state, before = ahead[index], self._ahead[index]
            if state is None or not state.detected:
                return
            comes_in = before is None or not before.detected
            if not comes_in and state.holds:
                return  # the train before
            self._entered.append(comes_in)
            self._proven_s.append(0.0)

    def _went_on(self, detected: bool, ahead: Sequence[CircuitState | None]) -> bool:
        """Whether a circuit that the train reached proves that it is there, and farther."""
        clear = [not detected, *(each is not None and not each.detected for each in ahead)]
        for index, comes_in in enumerate(self._entered):
            state = ahead[index]
            proves = (
                comes_in
                and state is not None
                and state.detected
                and self._heard_s[index] >= HEARD_AGAIN_S
                and clear[index]
                # A level near the threshold may be below it in one circuit only.
                and (state.shunted or (index > 0 and clear[index - 1]))
            )
            self._proven_s[index] = self._proven_s[index] + self._tick_s if proves else 0.0
        return any(proven_s >= self._long_s for proven_s in self._proven_s)
