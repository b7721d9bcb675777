"""What a track circuit tells the train in it: speeds, gradient and length of the block.

Speeds are chosen backwards, from the place
where a train must stand, so that a train that obeys every code on its way never needs more than
the nominal braking. From the entrance of a block to its end, with the coded length L and the
deceleration b on its gradient, a train may come down from v to e if

    v T + ((v + w)^2 - e^2) / (2 b) <= L

(``T`` reaction, ``w`` overspeed before brakes intervene), or if v <= e: no braking is needed.

The place to stand is the entrance of the overlap, the circuit before an occupied one; the end of
the line, and whatever is not known, is occupied.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, sqrt

from rail_signals.track_code.scales import LEAST_BRAKING_MPS2, CodeScales, deceleration_mps2


@dataclass(frozen=True)
class Block:
    """One track circuit.

    Parameters
    ----------
    length_m : float
    limit_mps : float
        Lowest speed limit in it.
    gradient_permil : float
        Steepest fall in it, negative downhill in the running direction.
    """

    length_m: float
    limit_mps: float
    gradient_permil: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.length_m < inf:
            raise ValueError(f"length_m: {self.length_m} is not a length")
        if not self.limit_mps >= 0.0:
            raise ValueError(f"limit_mps: {self.limit_mps} is not a speed")


class CodeLogic:
    """Codes of a circuit, from itself and those ahead of it.

    Parameters
    ----------
    blocks : sequence of Block
        The circuit itself, then those ahead in the running direction; past the last one the
        line ends.
    braking_mps2 : float
        Deceleration on level track that a train is sure to have.
    reaction_s : float
        From the entrance of a block until the train brakes for its code: window and
        confirmation of the receiver, notice of the new block, brake build-up.
    overspeed_mps : float
        By how much a train may be too fast once the brakes act.
    overlap : int
        Number of free circuits kept before an occupied one.
    network : int
        Value of the network field.
    scales : CodeScales
    longest_train_m : float
        Limits and gradients of the blocks that far behind a front still hold for its train.
        Of those behind the first block nothing is known here.

    Raises
    ------
    ValueError
        If there is no block, or a parameter is out of range.

    Examples
    --------
    >>> logic = CodeLogic([Block(500.0, 80 / 3.6)] * 4)
    >>> logic.fields([False, False, False])
    {'speed': 102, 'gradient': 10, 'block_length': 20, 'network': 0}
    >>> logic.fields([False, True, False])["speed"], logic.fields([None, False, False])["speed"]
    (64, 0)
    """

    def __init__(
        self,
        blocks: Sequence[Block],
        *,
        braking_mps2: float = 0.5,
        reaction_s: float = 4.5,
        overspeed_mps: float = 1.7,
        overlap: int = 1,
        network: int = 0,
        scales: CodeScales | None = None,
        longest_train_m: float = 0.0,
    ) -> None:
        if not blocks:
            raise ValueError("blocks: there is none")
        if not 0.0 < braking_mps2 < inf:
            raise ValueError(f"braking_mps2: {braking_mps2} is not above zero")
        if not (reaction_s >= 0.0 and overspeed_mps >= 0.0 and longest_train_m >= 0.0):
            raise ValueError("reaction_s, overspeed_mps, longest_train_m: must not be negative")
        if overlap < 0 or not 0 <= network < 8:
            raise ValueError(f"overlap: {overlap}, network: {network}: out of range")
        self.scales = scales or CodeScales()
        self._network, self._overlap = network, overlap
        self._reaction_s, self._overspeed_mps = reaction_s, overspeed_mps
        self._table_mps = [speed / 3.6 for speed in self.scales.speeds_kmh]
        self._lengths = [self.scales.length_index(block.length_m) for block in blocks]
        self._limits_mps: list[float] = []
        self._gradients: list[int] = []
        self._braking_mps2: list[float] = []
        for block in _under_trains(blocks, longest_train_m):
            self._limits_mps.append(block.limit_mps)
            self._gradients.append(self.scales.gradient_index(block.gradient_permil))
            # As the train will count it: by the gradient it is told.
            gradient_permil = self.scales.gradient_step_permil * (
                self._gradients[-1] - self.scales.gradient_zero
            )
            self._braking_mps2.append(deceleration_mps2(braking_mps2, gradient_permil))

    def fields(self, occupied: Sequence[bool | None]) -> dict[str, int]:
        """Fields of the first block's code.

        Parameters
        ----------
        occupied : sequence of bool or None
            Of the blocks ahead, the nearest first; None = not known. Whether the first block
            itself is occupied has no part in its own code.

        Raises
        ------
        ValueError
            If there is not one entry for every block ahead.
        """
        return self.all_fields([True, *occupied])[0]

    def all_fields(self, occupied: Sequence[bool | None]) -> list[dict[str, int]]:
        """Fields of every block's code; ``occupied`` of every block, the first included."""
        count = len(self._lengths)
        if len(occupied) != count:
            raise ValueError(f"occupied: {len(occupied)} blocks, not {count}")
        fields: list[dict[str, int]] = []
        free = 0  # blocks ahead without a train or the line's end
        entry_mps = 0.0  # at which the block ahead may be entered
        for index in range(count - 1, -1, -1):
            now = end = 0
            if free >= self._overlap:
                limit_mps = self._limits_mps[index]
                end_mps = 0.0 if free == self._overlap else min(limit_mps, entry_mps)
                end = self.scales.speed_index(end_mps)
                entry_limit_mps = self._entry_limit_mps(index, self._table_mps[end])
                now = self.scales.speed_index(min(limit_mps, entry_limit_mps))
            fields.append(
                {
                    "speed": now << 4 | end,
                    "gradient": self._gradients[index],
                    "block_length": self._lengths[index],
                    "network": self._network,
                }
            )
            entry_mps = self._table_mps[now]
            # Not known is occupied.
            free = free + 1 if occupied[index] is False else 0
        return fields[::-1]

    def _entry_limit_mps(self, index: int, end_mps: float) -> float:
        """Largest speed at the entrance from which ``end_mps`` is reached at the end."""
        length_m = self._lengths[index] * self.scales.length_step_m
        b = self._braking_mps2[index]
        return entry_limit_mps(length_m, b, end_mps, self._reaction_s, self._overspeed_mps)


def entry_limit_mps(
    length_m: float, braking_mps2: float, end_mps: float, reaction_s: float, overspeed_mps: float
) -> float:
    """Largest speed at the entrance of a block from which ``end_mps`` is reached at its end.

    Examples
    --------
    >>> round(3.6 * entry_limit_mps(500.0, 0.5, 0.0, 4.5, 1.7), 1)
    67.3
    """
    b, t, w = braking_mps2, reaction_s, overspeed_mps
    if b < LEAST_BRAKING_MPS2:
        return end_mps
    # u = v + w solves (u - w) T + (u^2 - e^2) / (2 b) = L.
    u = -b * t + sqrt((b * t) ** 2 + end_mps**2 + 2.0 * b * (length_m + w * t))
    return max(end_mps, u - w)


def _under_trains(blocks: Sequence[Block], longest_train_m: float) -> list[Block]:
    """Blocks with the lowest limit and the steepest fall under a train whose front is in them."""
    fields = []
    for index, block in enumerate(blocks):
        limit_mps, gradient_permil = block.limit_mps, block.gradient_permil
        behind_m = 0.0
        for other in reversed(blocks[:index]):
            if behind_m >= longest_train_m:
                break
            limit_mps = min(limit_mps, other.limit_mps)
            gradient_permil = min(gradient_permil, other.gradient_permil)
            behind_m += other.length_m
        fields.append(Block(block.length_m, limit_mps, gradient_permil))
    return fields
