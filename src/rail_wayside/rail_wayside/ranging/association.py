"""Which reading belongs to which train.

A reading carries no name. A train heard within the last second is where it was, plus what it can
have run since: its own reading is the one there. One not heard for longer may be in many places,
and so may others; it gets a reading only if there is one way alone to give every reading to a
train without letting trains on one track pass each other. Otherwise nobody gets it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

#: A train heard this recently is followed; later it has to be found again.
FOLLOWED_S = 1.0
#: Trains or readings that may be confused at once and are still told apart.
MOST_TOGETHER = 6


@dataclass(frozen=True)
class TrainCandidate:
    """A train, and the readings that can be its own.

    Parameters
    ----------
    train : int
    followed : bool
        Whether it was heard within `FOLLOWED_S`.
    misses : mapping of reading to float
        Distance from where it is expected over the distance allowed, at most 1.
    """

    train: int
    followed: bool
    misses: Mapping[int, float]


class RunningOrder:
    """Which of two trains is ahead; on one track that never changes."""

    def __init__(self) -> None:
        self._ahead: dict[tuple[int, int], bool] = {}

    def learn(self, rear: int, front: int, distance_m: float | None) -> None:
        """Take note of the distance from one train to another, both seen at once.

        None says that the two cannot reach each other in one direction.
        """
        if distance_m is None:
            self._ahead.pop((rear, front), None)
            self._ahead.pop((front, rear), None)
        elif distance_m != 0.0:
            self._ahead[rear, front] = distance_m > 0.0
            self._ahead[front, rear] = distance_m < 0.0

    def known(self) -> list[tuple[int, int]]:
        """Pairs whose order is known, each pair once."""
        return [(one, other) for one, other in self._ahead if one < other]

    def allows(self, one: int, other: int, distance_m: float | None) -> bool:
        """Whether ``other`` can be that far ahead of ``one`` (negative: behind)."""
        known = self._ahead.get((one, other))
        return known is None or distance_m is None or (distance_m > 0.0) == known


def associate(
    candidates: Sequence[TrainCandidate],
    distances_m: Mapping[tuple[int, int], float | None],
    order: RunningOrder,
) -> dict[int, int]:
    """Give readings to trains.

    Parameters
    ----------
    candidates : sequence of TrainCandidate
    distances_m : mapping
        Distance along the line from one reading to another [m]; missing or None where there is
        none.
    order : RunningOrder

    Returns
    -------
    dict of train to reading; trains and readings that cannot be told are missing.
    """
    owners: dict[int, int] = {}
    assigned: set[int] = set()
    offers = sorted(
        (miss, one.train, reading)
        for one in candidates
        if one.followed
        for reading, miss in one.misses.items()
    )
    for _, train, reading in offers:
        if train not in owners and reading not in assigned:
            owners[train] = reading
            assigned.add(reading)
    lost = []
    for one in candidates:
        if one.train in owners or one.followed:
            continue
        free = [
            reading
            for reading in one.misses
            if reading not in assigned
            and all(
                order.allows(one.train, train, distances_m.get((reading, theirs)))
                for train, theirs in owners.items()
            )
        ]
        if free:
            lost.append((one.train, free))
    for group in _confusable(lost):
        matching = _only_matching(group, distances_m, order)
        if matching is not None:
            owners.update(matching)
    return owners


def _confusable(lost: list[tuple[int, list[int]]]) -> list[list[tuple[int, list[int]]]]:
    """Trains in groups that share readings."""
    groups: list[tuple[set[int], list[tuple[int, list[int]]]]] = []
    for train, readings in lost:
        mine, members = set(readings), [(train, readings)]
        apart = []
        for theirs, others in groups:
            if theirs & mine:
                mine |= theirs
                members = [*others, *members]
            else:
                apart.append((theirs, others))
        groups = [*apart, (mine, members)]
    return [members for _, members in groups]


def _only_matching(
    group: list[tuple[int, list[int]]],
    distances_m: Mapping[tuple[int, int], float | None],
    order: RunningOrder,
) -> dict[int, int] | None:
    """Return the one way to give every reading of a group to a train, None if not just one."""
    readings = sorted({reading for _, free in group for reading in free})
    if len(readings) != len(group) or len(group) > MOST_TOGETHER:
        return None
    matchings = _matchings(group, {}, distances_m, order)
    matching = next(matchings, None)
    return matching if matching is not None and next(matchings, None) is None else None


def _matchings(
    group: Sequence[tuple[int, list[int]]],
    owners: dict[int, int],
    distances_m: Mapping[tuple[int, int], float | None],
    order: RunningOrder,
) -> Iterator[dict[int, int]]:
    if not group:
        yield dict(owners)
        return
    train, free = group[0]
    for reading in free:
        if reading in owners.values():
            continue
        if all(
            order.allows(train, other, distances_m.get((reading, theirs)))
            for other, theirs in owners.items()
        ):
            yield from _matchings(group[1:], {**owners, train: reading}, distances_m, order)
