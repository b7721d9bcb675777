"""The other half of a corridor that runs on two hosts: whether it has been there, and has ended."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any, Final

from rail_corridor.plan.plan import Part

#: What somebody else runs beside a part of the corridor.
ELSEWHERE: Final[dict[Part | None, str]] = {
    "wayside": "the onboard half",
    "onboard": "the wayside half",
    "report": "the corridor itself",
}
#: Wall time between two looks [s].
_LOOK_S: Final = 0.5


class OtherHalf:
    """Looks for the nodes of others in the graph.

    Parameters
    ----------
    nodes : collection of str
        Full names of those that tell: as long as one of them is there, the half is.
    patience_s : float
        Wall time after the first look until a half that never came is gone.
    """

    def __init__(self, nodes: Collection[str], patience_s: float = math.inf) -> None:
        self._nodes = frozenset(nodes)
        self._patience_s = patience_s
        self._first_s: float | None = None
        self._seen = False
        self._looked_s = 0.0
        #: Whether it has been there and is no longer, or has not come.
        self.gone = False

    @property
    def seen(self) -> bool:
        """Whether it has been there."""
        return self._seen

    def look(self, node: Any, failed: Collection[str] = ()) -> bool:
        """Look, now and then, through the eyes of a node: whether it is found gone just now.

        One whose nodes have all ``failed`` is gone as well: of a process that was killed the graph
        tells for another 20 s, of one that hangs for ever.
        """
        now_s = node.steady_s()
        # Until it has been seen, at every chance: it may be gone right after that.
        if self.gone or (self._seen and now_s - self._looked_s < _LOOK_S):
            return False
        self._looked_s = now_s
        if self._first_s is None:
            self._first_s = now_s
        names = (f"{space.rstrip('/')}/{n}" for n, space in node.get_node_names_and_namespaces())
        if self._nodes <= {*failed}:
            self.gone = self._seen
        elif not self._nodes.isdisjoint(names):
            self._seen = True
        elif self._seen or now_s - self._first_s > self._patience_s:
            self.gone = True
        return self.gone
