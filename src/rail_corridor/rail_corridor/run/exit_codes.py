"""Exit codes of ``rail run``."""

from __future__ import annotations

from typing import Final

#: The world itself or the recorder has failed.
FAILED: Final = 1
#: The run was unsafe.
UNSAFE: Final = 3
#: Nodes have failed that were not meant to.
NODES_FAILED: Final = 4
#: The other half of a split corridor has ended first.
HALF_GONE: Final = 5
#: ... of a run that a signal ended, with the number of the signal.
SIGNAL: Final = 128
