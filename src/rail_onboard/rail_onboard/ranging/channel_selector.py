"""Which channel pair the vehicle station works on, decided from what it hears alone.

The antenna of the train looks back along the line, and each station's antenna forward into
its zone. Passing a station, the train leaves the back of its antenna and enters the front, and
so does the station for the train's antenna: its channel rises by twice the front-to-back ratio
within a few metres, far above the station a zone away. The strongest channel is therefore that
of the zone the train is in - standing, running and reversing alike.

Where a line branches, two antennas of one station compete; they look outward on either side of
the train, so their levels part while the train passes between them. Until they have, the pair
in force is kept: its station still reaches the next zone.
"""

from __future__ import annotations

from collections.abc import Mapping

#: How much stronger another channel must be than the one in force [dB].
HYSTERESIS_DB = 3.0
#: How much stronger it must be than any third channel [dB].
LEAD_DB = 1.0


class ChannelSelector:
    """Keeps or changes the channel pair.

    Parameters
    ----------
    uplinks : mapping
        Uplink channel paired with each downlink channel.

    Examples
    --------
    >>> selector = ChannelSelector({1: 2, 3: 4})
    >>> selector.update({1: -60.0}), selector.update({1: -80.0, 3: -90.0})
    (1, 1)
    >>> selector.update({1: -80.0, 3: -50.0}), selector.uplink
    (3, 4)
    """

    def __init__(self, uplinks: Mapping[int, int]) -> None:
        self._uplinks = dict(uplinks)
        self.downlink: int | None = None

    @property
    def uplink(self) -> int | None:
        """Uplink channel of the pair in force."""
        return None if self.downlink is None else self._uplinks[self.downlink]

    def update(self, levels_dbm: Mapping[int, float]) -> int | None:
        """Downlink channel in force after hearing these levels; unheard channels are missing."""
        ranked = sorted(levels_dbm, key=lambda channel: (-levels_dbm[channel], channel))
        if not ranked:
            return self.downlink
        best = ranked[0]
        if best == self.downlink:
            return best
        rivals = [levels_dbm[channel] for channel in ranked[1:] if channel != self.downlink]
        if rivals and levels_dbm[best] - rivals[0] < LEAD_DB:
            return self.downlink
        in_force = levels_dbm.get(self.downlink) if self.downlink is not None else None
        if in_force is None or levels_dbm[best] - in_force > HYSTERESIS_DB:
            self.downlink = best
        return self.downlink
