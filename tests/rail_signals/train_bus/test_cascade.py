"""Lines of sections, couplers, stubs and faults against closed forms and scikit-rf."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

from rail_signals.train_bus.bus_line import (
    BusLine,
    CableSection,
    Coupler,
    Element,
    SeriesElement,
    ShuntElement,
    Stub,
    Termination,
)
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.cascade import (
    CascadePass,
    input_impedance,
    input_reflection,
    laplace_axis,
    transfer,
    wave_exponential,
)

LOSSLESS = Cable.from_impedance(120.0, 0.66)
LOSSY = Cable(0.9e-6, 65e-12, 0.05, 1e-6, 3e-4)
FREQUENCIES = np.geomspace(1e4, 1e8, 41)


def test_a_section_between_resistors() -> None:
    """``Z_in = Z0 (Z_L + Z0 tanh gl) / (Z0 + Z_L tanh gl)``."""
    bus_line = BusLine((CableSection(LOSSY, 33.0, 1.1, 0.97),), Termination(75.0))
    wave = LOSSY.wave_constants(laplace_axis(FREQUENCIES))
    z0, t = 1.1 * wave.impedance, np.tanh(wave.propagation * 33.0 * 0.97)
    expected = z0 * (75.0 + z0 * t) / (z0 + 75.0 * t)
    np.testing.assert_allclose(input_impedance(bus_line, FREQUENCIES), expected, rtol=1e-12)


def test_open_and_shorted_ends() -> None:
    """Cotangent and tangent; their product is the square of Z0."""
    opened = input_impedance(BusLine((CableSection(LOSSLESS, 10.0),)), FREQUENCIES)
    shorted = input_impedance(
        BusLine((CableSection(LOSSLESS, 10.0),), Termination(0.0)), FREQUENCIES
    )
    angle = 2 * math.pi * FREQUENCIES * 10.0 / LOSSLESS.velocity_m_per_s
    np.testing.assert_allclose(opened, -120j / np.tan(angle), rtol=1e-9)
    np.testing.assert_allclose(opened * shorted, np.full(41, 120.0**2), rtol=1e-9)
    assert math.isinf(input_impedance(BusLine(()), [1e6])[0].real)


def test_a_line_of_nothing_is_its_load() -> None:
    rho = input_reflection(BusLine((), Termination(60.0)), [1e6], 120.0)
    assert complex(rho[0]) == pytest.approx(-1 / 3)
    # 27 ohm and 1.3 nF, the idle circuit of S2, Fig 4: 35.1 ns.
    idle = complex(input_impedance(BusLine((), Termination(27.0, 1.3e-9)), [1e6])[0])
    assert idle == pytest.approx(27.0 + 1 / (2j * math.pi * 1e6 * 1.3e-9))


def test_nothing_is_lost_where_nothing_can_be() -> None:
    """Of a lossless line power that is not reflected arrives, and reflections stay below one."""
    section = CableSection(LOSSLESS, 23.0, 0.8)
    parts: list[Element] = [section, SeriesElement(0.0, 1e-7), ShuntElement(0.0, 4e-11), section]
    bus_line = BusLine(tuple(parts), Termination(90.0))
    rho = input_reflection(bus_line, FREQUENCIES, 120.0)
    arrived = np.abs(transfer(bus_line, FREQUENCIES, 120.0)[-1]) ** 2 * 120.0 / 90.0
    np.testing.assert_allclose(np.abs(rho) ** 2 + arrived, 1.0, rtol=1e-12)


def test_the_transfer_of_a_matched_line_is_delay_and_loss() -> None:
    sections = tuple(CableSection(LOSSLESS, length) for length in (10.0, 0.0, 25.0))
    found = transfer(BusLine(sections, Termination(120.0)), FREQUENCIES, 120.0)
    travelled = np.array([0.0, 10.0, 10.0, 35.0])[:, None]
    expected = np.exp(-2j * np.pi * FREQUENCIES * travelled / LOSSLESS.velocity_m_per_s)
    np.testing.assert_allclose(found, expected, rtol=1e-10)
    long = BusLine((CableSection(LOSSY, 860.0),), Termination(118.0))
    wave = LOSSY.wave_constants(laplace_axis(FREQUENCIES))
    v = transfer(long, FREQUENCIES, 118.0)
    head = 2 * (z := input_impedance(long, FREQUENCIES)) / (z + 118.0)
    back = (118.0 - wave.impedance) / (118.0 + wave.impedance)
    one_way = np.exp(-wave.propagation * 860.0)
    expected = head * one_way * (1 + back) / (1 + back * one_way**2)
    np.testing.assert_allclose(v[-1], expected, rtol=1e-9)


def test_a_stub_and_its_node() -> None:
    """At a quarter wave an open stub shorts the line; its end carries the voltage."""
    quarter_hz = LOSSLESS.velocity_m_per_s / (4 * 1.0)
    stub = Stub(CableSection(LOSSLESS, 1.0))
    bus_line = BusLine(
        (CableSection(LOSSLESS, 5.0), stub, CableSection(LOSSLESS, 5.0)), Termination(120.0)
    )
    rows = transfer(bus_line, [quarter_hz, 1e3], 120.0)
    assert abs(rows[2][0]) < 1e-12
    assert abs(rows[2][1]) == pytest.approx(1.0, abs=1e-4)
    at_loads = transfer(bus_line, [1e6], 120.0, load_ends=True)
    tapped = transfer(bus_line, [1e6], 120.0)
    angle = 2 * math.pi * 1e6 * 1.0 / LOSSLESS.velocity_m_per_s
    assert complex(at_loads[2, 0] / tapped[2, 0]) == pytest.approx(1 / math.cos(angle))
    loaded = Stub(CableSection(LOSSLESS, 0.0), Termination(1e3), 30e-12)
    y = CascadePass(laplace_axis([1e6])).stub_admittance(loaded)
    assert complex(y[0]) == pytest.approx(1e-3 + 2j * math.pi * 1e6 * 30e-12)


def test_long_lines_stay_in_range() -> None:
    """A thousand sections double what describes them a thousand times."""
    bus_line = BusLine((CableSection(LOSSLESS, 1.0),) * 1500, Termination(60.0))
    once = input_reflection(
        BusLine((CableSection(LOSSLESS, 1500.0),), Termination(60.0)), [1e6], 120.0
    )
    np.testing.assert_allclose(input_reflection(bus_line, [1e6], 120.0), once, rtol=1e-9)


def test_the_wave_exponential_is_the_exponential() -> None:
    rng = np.random.default_rng(1)
    loss, phase = rng.uniform(0, 0.1, 1000), rng.uniform(0, 10, 1000)
    out = np.empty(1000, dtype=np.complex128)
    wave_exponential(loss, phase, 40.0, out)
    np.testing.assert_allclose(out, np.exp(-(loss + 1j * phase) * 40.0), atol=5e-16, rtol=1e-13)
    half_turn = wave_exponential(np.zeros(1), np.array([math.pi]), 1.0, out[:1])
    assert complex(half_turn[0]) == pytest.approx(-1.0)


def test_wrong_values_are_quoted() -> None:
    bus_line = BusLine((CableSection(LOSSLESS, 1.0),))
    with pytest.raises(ValueError, match=r"reference_ohm must be .*0.0"):
        input_reflection(bus_line, [1e6], 0.0)
    with pytest.raises(ValueError, match=r"frequency_hz must be one axis"):
        input_reflection(bus_line, [-1.0], 120.0)
    with pytest.raises(ValueError, match=r"length_m must be .*-1.0"):
        CableSection(LOSSLESS, -1.0)
    with pytest.raises(ValueError, match=r"resistance_ohm must be 0 or more, got -1"):
        Termination(-1)
    with pytest.raises(TypeError, match=r"not an element of a line: 'wire'"):
        input_reflection(BusLine(("wire",)), [1e6], 120.0)  # type: ignore[arg-type]


def _draw(rng: np.random.Generator, kind: str, cables: list[Cable]) -> Element:
    """A random element; lengths from nothing to a long car."""
    if kind == "section":
        cable = cables[rng.integers(len(cables))]
        return CableSection(
            cable, rng.uniform(0.1, 60.0), rng.uniform(0.8, 1.2), rng.uniform(0.9, 1.1)
        )
    if kind == "coupler":
        return Coupler(rng.uniform(0, 1), rng.uniform(0, 2e-7), rng.uniform(0, 3e-11))
    if kind == "series":
        return SeriesElement(rng.uniform(0, 50), rng.uniform(0, 2e-7), rng.uniform(1e-10, 1e-8))
    if kind == "shunt":
        return ShuntElement(rng.uniform(0, 0.02), rng.uniform(0, 1e-10))
    section = CableSection(cables[0], rng.uniform(0.1, 1.0))
    load = Termination(rng.uniform(20, 1e4), rng.uniform(1e-10, 1e-8))
    return Stub(section, load, rng.uniform(0, 5e-11))


TEMPLATES = [
    ("section", "stub", "coupler", "section", "stub", "coupler", "section", "stub"),
    ("section", "series", "section", "coupler", "section", "shunt", "section"),
    ("coupler", "section", "section", "section", "stub", "section"),
    ("shunt", "series", "section", "stub", "series", "section", "coupler", "section"),
    ("section",) * 10,
]


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda t: f"{len(t)}_{t[0]}_{t[1]}")
def test_200_random_cascades_agree_with_scikit_rf(template: tuple[str, ...]) -> None:
    """Reflection and transfer of 1000 cascades in all, to 1e-9.

    Networks of scikit-rf hold one value per frequency, so that the elements of all cascades
    of a shape go through its cascading at once: the axis counts cascades and frequencies.
    """
    rf = pytest.importorskip("skrf", reason="scikit-rf, of the extra 'dev', is not installed")
    from skrf import media
    from skrf.network import a2s, z2s

    cases, reference = 200, 120.0
    rng = np.random.default_rng(TEMPLATES.index(template))
    frequencies = np.array([1e4, 2.5e5, 1e6, 3.3e6, 2e7, 9e7])
    s = laplace_axis(frequencies)
    cables = [
        LOSSLESS,
        LOSSY,
        Cable.from_impedance(75.0, 0.8, 0.1, 1e-5),
        Cable.from_impedance(150.0, 0.5, 0.02, 0.0, 5e-4),
    ]
    lines, loads = [], []
    for _ in range(cases):
        elements = tuple(_draw(rng, kind, cables) for kind in template)
        loads.append(float(rng.uniform(30.0, 500.0)))
        lines.append(BusLine(elements, Termination(loads[-1])))
    axis = rf.Frequency.from_f(np.arange(1, cases * len(s) + 1), unit="hz")

    def network(a: np.ndarray) -> object:
        return rf.Network(frequency=axis, s=a2s(a, reference), z0=reference)

    def lumped(series: np.ndarray, shunt: np.ndarray) -> object:
        """A series impedance, then an admittance across."""
        a = np.zeros((len(series), 2, 2), dtype=complex)
        a[:, 0, 0], a[:, 0, 1], a[:, 1, 0], a[:, 1, 1] = 1 + series * shunt, series, shunt, 1
        return network(a)

    def cable(sections: list[CableSection]) -> object:
        waves = [e.cable.wave_constants(s) for e in sections]
        pairs = list(zip(waves, sections, strict=True))
        gamma = np.concatenate([w.propagation * e.length_m * e.delay_factor for w, e in pairs])
        z0 = np.concatenate([w.impedance * e.impedance_factor for w, e in pairs])
        bus_line = media.DefinedGammaZ0(axis, gamma=gamma, z0=z0).line(1.0, "m")
        bus_line.renormalize(reference)
        return bus_line

    def stub_admittance(stubs: list[Stub]) -> np.ndarray:
        inner = lumped(np.zeros(len(axis)), np.concatenate([e.capacitance_f * s for e in stubs]))
        load = np.concatenate(
            [e.load.resistance_ohm + 1 / (s * e.load.capacitance_f) for e in stubs]
        )
        end = rf.Network(frequency=axis, s=z2s(load[:, None, None], reference), z0=reference)
        return 1 / (cable([e.section for e in stubs]) ** inner**end).z[:, 0, 0]  # type: ignore[operator]

    chain = None
    zeros = np.zeros(len(axis))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for position, kind in enumerate(template):
            column = [bus_line.elements[position] for bus_line in lines]
            if kind == "section":
                part = cable(column)  # type: ignore[arg-type]
            elif kind == "stub":
                part = lumped(zeros, stub_admittance(column))  # type: ignore[arg-type]
            elif kind == "shunt":
                part = lumped(zeros, np.concatenate([e.admittance(s) for e in column]))  # type: ignore[union-attr]
            elif kind == "series":
                part = lumped(np.concatenate([e.impedance(s) for e in column]), zeros)  # type: ignore[union-attr]
            else:
                part = lumped(
                    np.concatenate([e.resistance_ohm + s * e.inductance_h for e in column]),  # type: ignore[union-attr]
                    np.concatenate([s * e.capacitance_f for e in column]),  # type: ignore[union-attr]
                )
            chain = part if chain is None else chain**part  # type: ignore[operator]
        ends = np.repeat(loads, len(s))
        load = z2s(ends[:, None, None].astype(complex), reference)
        whole = chain ** rf.Network(frequency=axis, s=load, z0=reference)  # type: ignore[operator]
        chain.renormalize(np.stack([np.full(len(axis), reference), ends], axis=1))  # type: ignore[union-attr]
    reflection = whole.s[:, 0, 0].reshape(cases, -1)
    # A wave of the port's own impedance: V2 = S21 sqrt(Z2 / Z1) for 1 V into a matched load.
    arriving = (chain.s[:, 1, 0] * np.sqrt(ends / reference)).reshape(cases, -1)  # type: ignore[union-attr]
    for k, bus_line in enumerate(lines):
        ours = input_reflection(bus_line, frequencies, reference)
        assert np.abs(ours - reflection[k]).max() < 1e-9
        assert np.abs(transfer(bus_line, frequencies, reference)[-1] - arriving[k]).max() < 1e-9
