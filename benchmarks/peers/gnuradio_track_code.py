"""GNU Radio as a track-code receiver: mix, filter, decimate, quadrature demodulation, tones.

Runs under the interpreter that has GNU Radio, as a child of ``track_code_decode.py``::

    python3 gnuradio_track_code.py SIGNAL.npz REPEATS

SIGNAL.npz holds ``samples`` float32, ``rate_hz``, ``carrier_hz``, the design of the slot
``matrix`` complex64 [tones, slot], ``threshold`` [tones], ``hop`` in samples at 64 Hz and
the filters ``front_taps`` (to 640 Hz) and ``back_taps`` (to 64 Hz). Prints one JSON object:
CPU seconds of each pass (all threads of the flowgraph together, and the tones) and the
words of the first as integers.

The front end is the cheapest form found: one decimating filter whose complex taps mix and
filter at once, a quadrature demodulator at 640 Hz and a decimating filter to 64 Hz. Tones
are measured by NumPy, all slots in one product: faster than any blocks of a flowgraph.
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


def flowgraph(
    samples: np.ndarray, rate_hz: float, carrier_hz: float, front: np.ndarray, back: np.ndarray
) -> tuple[gr.top_block, blocks.vector_sink_f]:
    """Source, front end, discriminator, low-pass; deviations [Hz] at 64 Hz."""
    top = gr.top_block()
    source = blocks.vector_source_f(samples, False)
    decimation = round(rate_hz / MIDDLE_HZ)
    mixer = gr_filter.freq_xlating_fir_filter_fcf(decimation, front, carrier_hz, rate_hz)
    demodulator = analog.quadrature_demod_cf(MIDDLE_HZ / (2 * np.pi))
    low_pass = gr_filter.fir_filter_fff(round(MIDDLE_HZ / SLOT_HZ), back)
    sink = blocks.vector_sink_f()
    top.connect(source, mixer, demodulator, low_pass, sink)
    return top, sink


def words(deviation: np.ndarray, matrix: np.ndarray, threshold: np.ndarray, hop: int) -> list[int]:
    """Words of all slots of the deviation [Hz], as integers."""
    slots = np.lib.stride_tricks.sliding_window_view(deviation, matrix.shape[1])[::hop]
    both = np.concatenate([matrix.real, matrix.imag]).T.astype(np.float32)
    parts = slots @ both
    tones = len(threshold)
    bits = np.hypot(parts[:, :tones], parts[:, tones:]) > threshold
    return [int(v) for v in bits @ (1 << np.arange(tones, dtype=np.int64))]


def main() -> None:
    """Time the passes and print the result."""
    given = np.load(sys.argv[1])
    samples, front, back = given["samples"], given["front_taps"], given["back_taps"]
    numbers = float(given["rate_hz"]), float(given["carrier_hz"])
    matrix, threshold, hop = given["matrix"], given["threshold"], int(given["hop"])
    cpu_s = []
    found: list[int] = []
    for _ in range(int(sys.argv[2])):
        top, sink = flowgraph(samples, *numbers, front, back)
        start = time.process_time()
        top.run()
        deviation = np.asarray(sink.data(), dtype=np.float32)
        found = words(deviation, matrix, threshold, hop)
        cpu_s.append(time.process_time() - start)
    print(json.dumps({"cpu_s": cpu_s, "words": found}))


if __name__ == "__main__":
    main()
