"""GNU Radio as a ranging receiver: quadrature demodulation, tone correlation, phase.

Runs under the interpreter that has GNU Radio, as a child of ``ranging_receive.py``::

    python3 gnuradio_ranging.py BURSTS.npy CYCLES_PER_PERIOD PERIOD_SAMPLES REPEATS

BURSTS.npy holds complex64 [bursts, samples]. Prints one JSON object: CPU seconds of each
pass over the file (all threads of the flowgraph together) and the phase lags of the first.
The tone mixer and the integrator are one decimating filter with complex taps, the
cheapest form found: one dot product for each burst.
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np
from gnuradio import analog, blocks, gr
from gnuradio import filter as gr_filter


def flowgraph(bursts: np.ndarray, taps: np.ndarray) -> tuple[gr.top_block, blocks.vector_sink_f]:
    """Source, discriminator, correlator and phase; one output for each burst."""
    top = gr.top_block()
    samples = bursts.shape[1]
    # The filter's first output needs a whole burst: begin with the last sample of one.
    stream = np.roll(bursts.ravel(), 1 - samples)
    source = blocks.vector_source_c(stream, False)
    correlator = gr_filter.fir_filter_fcc(samples, taps)
    phase = blocks.complex_to_arg(1)
    sink = blocks.vector_sink_f()
    top.connect(source, analog.quadrature_demod_cf(1.0), correlator, phase, sink)
    return top, sink


def main() -> None:
    """Time the passes and print the result."""
    path, cycles, period, repeats = sys.argv[1], *map(int, sys.argv[2:5])
    bursts = np.load(path)
    samples = bursts.shape[1]
    # A filter convolves: reverse the taps. The discriminator is half a sample late.
    turn = 2 * np.pi * cycles / period * (np.arange(samples) - 0.5)
    reference = np.exp(-1j * turn)
    reference[0] = 0  # its phase step reaches into the burst before
    taps = reference[::-1].astype(np.complex64)
    cpu_s = []
    lag = np.zeros(0)
    for _ in range(repeats):
        top, sink = flowgraph(bursts, taps)
        start = time.process_time()
        top.run()
        cpu_s.append(time.process_time() - start)
        lag = np.mod(-np.asarray(sink.data()), 2 * np.pi)
    # The first output has only a part of its burst, the rest is in the order of the file.
    print(json.dumps({"cpu_s": cpu_s, "phase_lag_rad": [None, *lag[1:].tolist()]}))


if __name__ == "__main__":
    main()
