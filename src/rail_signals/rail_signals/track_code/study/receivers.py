"""The receivers whose errors can be counted, by name.

==============  ========================================================================
``near``        fit of the whole slot, started at the truth
``tracked``     the same fit, started from the slots before
``ml``          the same fit, searched for from scratch
``chain_bits``  the document's chain, bits of one slot alone
``chain_lost``  the document's chain with all its rules
==============  ========================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal, TypeAlias

from .chain_errors import count_chain_bits, count_chain_lost
from .error_count import Counter
from .fit_errors import count_ml, count_near, count_tracked

Receiver: TypeAlias = Literal["near", "tracked", "ml", "chain_bits", "chain_lost"]

COUNTERS: Final[Mapping[Receiver, Counter]] = {
    "near": count_near,
    "tracked": count_tracked,
    "ml": count_ml,
    "chain_bits": count_chain_bits,
    "chain_lost": count_chain_lost,
}
