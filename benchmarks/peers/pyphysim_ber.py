"""pyphysim as a diversity link: its QPSK, its channel deviates, its Alamouti code.

Runs under an interpreter that has pyphysim, as a child of ``cbtc_ber.py``::

    python pyphysim_ber.py SCHEME EB_N0_DB BITS REPEATS SEED

SCHEME is ``siso``, ``mrc``, ``alamouti_2x1`` or ``alamouti_2x2``. Prints one JSON object:
CPU seconds of each pass, all threads together, bits of a pass, errors of all passes, and the
bits that share a channel.

`pyphysim.mimo.Alamouti` takes one channel matrix at a time and loops over code blocks in
Python. It is given a new matrix every 32 code blocks instead of every one, which is faster
and gives the same mean error rate. Its combiner of receivers has the same limit, so that for
the schemes of one transmitter combining is plain NumPy with a channel per two symbols.
"""

from __future__ import annotations

import json
import math
import sys
import time

import numpy as np
from pyphysim.mimo.mimo import Alamouti
from pyphysim.modulators import QPSK
from pyphysim.util.misc import count_bit_errors, randn_c

SIZES = {"siso": (1, 1), "mrc": (1, 2), "alamouti_2x1": (2, 1), "alamouti_2x2": (2, 2)}
FRAME = 32
BLOCKS = 4096


class Link:
    """Frames of QPSK symbols through a channel drawn for each of them."""

    def __init__(self, scheme: str, eb_n0_db: float) -> None:
        self._tx, self._rx = SIZES[scheme]
        # A symbol of unit energy carries two bits; `encode` shares it among transmitters.
        self._sigma = math.sqrt(0.5 / 10 ** (eb_n0_db / 10))
        self._qpsk = QPSK()
        self._code = Alamouti()
        self.group_bits = 4 * FRAME if self._tx == 2 else 4

    def run(self, blocks: int) -> int:
        """Wrong bits of some code blocks."""
        sent = np.random.randint(0, 4, 2 * blocks)  # noqa: NPY002
        symbols = self._qpsk.modulate(sent)
        found = self._alamouti(symbols) if self._tx == 2 else self._combine(symbols)
        return int(count_bit_errors(sent, self._qpsk.demodulate(found)))

    def _alamouti(self, symbols: np.ndarray) -> np.ndarray:
        code, rx = self._code, self._rx
        coded = code.encode(symbols)
        noise = self._sigma * randn_c(rx, symbols.size)
        found = np.empty(symbols.size, dtype=complex)
        for i in range(0, symbols.size, 2 * FRAME):
            part = slice(i, i + 2 * FRAME)
            channel = randn_c(rx, 2)
            code.set_channel_matrix(channel)
            found[part] = code.decode(channel @ coded[:, part] + noise[:, part])
        return found

    def _combine(self, symbols: np.ndarray) -> np.ndarray:
        rx, pairs = self._rx, symbols.size // 2
        channel = randn_c(rx, pairs, 1)
        heard = channel * symbols.reshape(pairs, 2) + self._sigma * randn_c(rx, pairs, 2)
        return np.asarray((channel.conj() * heard).sum(axis=0).ravel())


def main() -> None:
    """Count and print."""
    scheme, eb_n0_db, bits, repeats, seed = sys.argv[1:]
    np.random.seed(int(seed))  # noqa: NPY002 - pyphysim draws from the global state
    link = Link(scheme, float(eb_n0_db))
    calls = max(1, int(bits) // (4 * BLOCKS))
    link.run(BLOCKS)
    errors, cpu_s = 0, []
    for _ in range(int(repeats)):
        start = time.process_time()
        errors += sum(link.run(BLOCKS) for _ in range(calls))
        cpu_s.append(time.process_time() - start)
    answer = {"cpu_s": cpu_s, "bits": 4 * BLOCKS * calls, "errors": errors}
    print(json.dumps({**answer, "group_bits": link.group_bits}))


if __name__ == "__main__":
    main()
