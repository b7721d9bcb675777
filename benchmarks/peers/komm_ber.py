"""komm as an Alamouti link: its QPSK and its Gray labels, the rest in NumPy.

Runs under an interpreter that has komm, as a child of ``cbtc_ber.py``::

    python komm_ber.py SCHEME EB_N0_DB BITS REPEATS SEED

SCHEME is ``siso``, ``mrc``, ``alamouti_2x1`` or ``alamouti_2x2``. Prints one JSON object:
CPU seconds of each pass, all threads together, bits of a pass, errors of all passes, and the
bits that share a channel.

komm has no space-time code and no fading channel, so that these two are plain NumPy, as one
writes them. Gray QPSK is two bits per symbol: `komm.PSKConstellation` turns labels into
symbols and received values into labels, by tables and `np.angle`; the labels stand for bits
by `komm.ReflectedLabeling`. The length of a pass was chosen for the highest rate.
"""

from __future__ import annotations

import json
import math
import sys
import time

import komm
import numpy as np

SIZES = {"siso": (1, 1), "mrc": (1, 2), "alamouti_2x1": (2, 1), "alamouti_2x2": (2, 2)}
BLOCKS = 1024


class Link:
    """Blocks of two QPSK symbols through a channel drawn for each of them."""

    def __init__(self, scheme: str, eb_n0_db: float, seed: int) -> None:
        self._tx, self._rx = SIZES[scheme]
        self._rng = np.random.default_rng(seed)
        # A symbol of unit energy carries two bits; each transmitter sends its share.
        self._sigma = math.sqrt(0.5 / 10 ** (eb_n0_db / 10) * self._tx)
        self._qpsk = komm.PSKConstellation(4, phase_offset=1 / 8)
        labels = komm.ReflectedLabeling(2).matrix @ [2, 1]
        # Wrong bits by index sent and index found.
        self._wrong = np.array([[bin(a ^ b).count("1") for b in labels] for a in labels])

    def _normal(self, *shape: int) -> np.ndarray:
        """Complex normal deviates of unit power."""
        parts = self._rng.standard_normal((*shape, 2))
        return parts.view(np.complex128)[..., 0] * math.sqrt(0.5)

    def run(self, blocks: int) -> int:
        """Wrong bits of some blocks."""
        sent = self._rng.integers(4, size=(2, blocks))
        x1, x2 = self._qpsk.indices_to_symbols(sent)
        h = self._normal(self._rx, self._tx, blocks)
        z1, z2 = self._sigma * self._normal(2, self._rx, blocks)
        h1 = h[:, 0]
        if self._tx == 1:
            y1 = h1 * x1 + z1
            y2 = h1 * x2 + z2
            found1 = (h1.conj() * y1).sum(axis=0)
            found2 = (h1.conj() * y2).sum(axis=0)
        else:
            h2 = h[:, 1]
            y1 = h1 * x1 + h2 * x2 + z1
            y2 = -h1 * x2.conj() + h2 * x1.conj() + z2
            found1 = (h1.conj() * y1 + h2 * y2.conj()).sum(axis=0)
            found2 = (h2.conj() * y1 - h1 * y2.conj()).sum(axis=0)
        found = self._qpsk.closest_indices(np.stack([found1, found2]))
        return int(self._wrong[sent, found].sum())


def main() -> None:
    """Count and print."""
    scheme, eb_n0_db, bits, repeats, seed = sys.argv[1:]
    link = Link(scheme, float(eb_n0_db), int(seed))
    calls = max(1, int(bits) // (4 * BLOCKS))
    link.run(BLOCKS)
    errors, cpu_s = 0, []
    for _ in range(int(repeats)):
        start = time.process_time()
        errors += sum(link.run(BLOCKS) for _ in range(calls))
        cpu_s.append(time.process_time() - start)
    answer = {"cpu_s": cpu_s, "bits": 4 * BLOCKS * calls, "errors": errors}
    print(json.dumps({**answer, "group_bits": 4}))


if __name__ == "__main__":
    main()
