"""GNU Radio as a track-code receiver: mix, filter, decimate, quadrature demodulation, tones.

Runs under the interpreter that has GNU Radio, as a child of ``track_code_decode.py``::

    python3 gnuradio_track_code.py SIGNAL.npz REPEATS

SIGNAL.npz holds ``samples`` float32, ``rate_hz``, ``carrier_hz``, the design of the slot
``matrix`` complex64 [tones, slot], ``threshold`` [tones], ``hop`` in samples at 64 Hz and
the filters ``front_taps`` (to 640 Hz) and ``back_taps`` (to 64 Hz). Prints one JSON object:
CPU seconds of each pass, all threads together, of two forms, and the words found by the
last pass of each, as integers.

The front end of both is the cheapest found: one decimating filter whose complex taps mix and
filter at once, a quadrature demodulator at 640 Hz and a decimating filter to 64 Hz. Then
``alone`` measures the tones by blocks of GNU Radio: a filter per tone whose taps are a row of
the matrix, once per hop, and its magnitude. ``with_numpy`` takes the flowgraph's samples at
64 Hz and measures all slots in one product of matrices.
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np
from gnuradio import analog, blocks, gr
from gnuradio import filter as gr_filter

MIDDLE_HZ = 640.0
SLOT_HZ = 64.0


Signal = tuple[np.ndarray, float, float, np.ndarray, np.ndarray]


class Alone:
    """All in one flowgraph."""

    def __init__(self, signal: Signal, matrix: np.ndarray, threshold: np.ndarray, hop: int) -> None:
        self._top, deviation = front_end(signal)
        self._threshold = threshold
        self._sink = blocks.vector_sink_f(len(threshold))
        self._slot = matrix.shape[1]
        self._hop = hop
        together = blocks.streams_to_vector(gr.sizeof_float, len(threshold))
        for k, row in enumerate(matrix):
            # Taps run backwards in time.
            tone = gr_filter.fir_filter_fcc(hop, row[::-1].tolist())
            level = blocks.complex_to_mag()
            self._top.connect(deviation, tone, level, (together, k))
        self._top.connect(together, self._sink)

    def words(self) -> list[int]:
        """Run, and return the words of all slots."""
        self._top.run()
        levels = np.asarray(self._sink.data(), dtype=np.float32)
        # The filters begin before the first sample; whole slots only.
        first = self._slot // self._hop
        return packed(levels.reshape(-1, len(self._threshold))[first:] > self._threshold)


class WithNumpy:
    """A flowgraph down to 64 Hz, then NumPy."""

    def __init__(self, signal: Signal, matrix: np.ndarray, threshold: np.ndarray, hop: int) -> None:
        self._top, deviation = front_end(signal)
        self._sink = blocks.vector_sink_f()
        self._top.connect(deviation, self._sink)
        self._matrix, self._threshold, self._hop = matrix, threshold, hop

    def words(self) -> list[int]:
        """Run, and return the words of all slots."""
        self._top.run()
        deviation = np.asarray(self._sink.data(), dtype=np.float32)
        slots = np.lib.stride_tricks.sliding_window_view(deviation, self._matrix.shape[1])
        both = np.concatenate([self._matrix.real, self._matrix.imag]).T.astype(np.float32)
        parts = slots[:: self._hop] @ both
        tones = len(self._threshold)
        return packed(np.hypot(parts[:, :tones], parts[:, tones:]) > self._threshold)


def front_end(signal: Signal) -> tuple[gr.top_block, gr.basic_block]:
    """Source, mixer and low-pass, discriminator, low-pass; deviations [Hz] at 64 Hz."""
    samples, rate_hz, carrier_hz, front, back = signal
    top = gr.top_block()
    source = blocks.vector_source_f(samples, False)
    decimation = round(rate_hz / MIDDLE_HZ)
    mixer = gr_filter.freq_xlating_fir_filter_fcf(decimation, front, carrier_hz, rate_hz)
    demodulator = analog.quadrature_demod_cf(MIDDLE_HZ / (2 * np.pi))
    low_pass = gr_filter.fir_filter_fff(round(MIDDLE_HZ / SLOT_HZ), back)
    top.connect(source, mixer, demodulator, low_pass)
    return top, low_pass


def packed(bits: np.ndarray) -> list[int]:
    """Words [n] of bits [n, tones]."""
    return [int(v) for v in bits @ (1 << np.arange(bits.shape[1], dtype=np.int64))]


def main() -> None:
    """Time the passes and print the result."""
    given = np.load(sys.argv[1])
    signal = (
        given["samples"],
        float(given["rate_hz"]),
        float(given["carrier_hz"]),
        given["front_taps"],
        given["back_taps"],
    )
    tones = given["matrix"], given["threshold"], int(given["hop"])
    answer = {}
    for name, form in {"alone": Alone, "with_numpy": WithNumpy}.items():
        cpu_s = []
        for _ in range(int(sys.argv[2])):
            receiver = form(signal, *tones)
            start = time.process_time()
            found = receiver.words()
            cpu_s.append(time.process_time() - start)
        answer[name] = {"cpu_s": cpu_s, "words": found}
    print(json.dumps(answer))


if __name__ == "__main__":
    main()
