"""Where a train enters a block: the joint at which the carrier in the rails changes."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite


class BlockEntries:
    """Finds the joints passed from the carriers that the receiver holds on to.

    Parameters
    ----------
    joints_m : sequence of float
        Chainages of the joints, increasing [m].
    carriers_hz : sequence of float
        Carrier of the block behind each joint, in the direction of travel [Hz].
    within_m : float
        A joint counts if it is so near to where the train believes to be [m].

    Examples
    --------
    >>> entries = BlockEntries([500.0, 1000.0], [2300.0, 1700.0])
    >>> entries.entered(1700.0, 480.0), entries.entered(2300.0, 508.0)
    (None, 500.0)
    """

    def __init__(
        self, joints_m: Sequence[float], carriers_hz: Sequence[float], within_m: float = 60.0
    ) -> None:
        if len(joints_m) != len(carriers_hz):
            raise ValueError(f"joints_m: {len(joints_m)} for {len(carriers_hz)} carriers")
        self._joints = list(zip(joints_m, carriers_hz, strict=True))
        self._within_m = within_m
        self.reset()

    def reset(self) -> None:
        """Forget the carrier, as when switched on: the next is that of where the train is."""
        self._carrier_hz = 0.0

    def entered(self, carrier_hz: float, believed_m: float) -> float | None:
        """Chainage of the joint just passed, None if none was.

        Two joints that fit say nothing: a wrong one would be worse. No carrier, and one that is not
        a number, breaks the comparison: the next one may be that of the same block.
        """
        received = isfinite(carrier_hz) and carrier_hz > 0.0
        before, self._carrier_hz = self._carrier_hz, carrier_hz if received else 0.0
        if not received or carrier_hz == before or before == 0.0:
            return None
        if not isfinite(believed_m):
            return None
        near = [
            joint_m
            for joint_m, behind_hz in self._joints
            if behind_hz == carrier_hz and abs(joint_m - believed_m) <= self._within_m
        ]
        return near[0] if len(near) == 1 else None
