from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import fresnel

from rail_world.line.alignment import Alignment, Element


def integrated(element: Element, s: float) -> complex:
    """Position on an element by adaptive quadrature, piece by piece: the slow oracle."""
    k0 = element.start_curvature_per_m
    rate = (element.end_curvature_per_m - k0) / element.length_m
    knots = np.linspace(0.0, s, 20)
    total = 0j
    for a, b in pairwise(knots):
        for part, factor in ((math.cos, 1), (math.sin, 1j)):
            value, _ = quad(
                lambda t, part=part: part(k0 * t + 0.5 * rate * t * t),
                a,
                b,
                epsabs=1e-11,
                epsrel=1e-11,
            )
            total += factor * value
    return total


def test_straight_runs_along_its_heading() -> None:
    line = Alignment([Element(250.0)], x_m=10.0, y_m=-5.0, heading_rad=math.radians(30.0))
    x, y, heading = line.pose([0.0, 100.0, 250.0])
    np.testing.assert_allclose(x, 10.0 + np.array([0, 100, 250]) * math.cos(math.pi / 6))
    np.testing.assert_allclose(y, -5.0 + np.array([0, 100, 250]) * 0.5)
    np.testing.assert_allclose(heading, math.pi / 6)


@pytest.mark.parametrize("radius_m", [300.0, -300.0, 25.0, -1e6])
def test_arc_ends_where_the_circle_says(radius_m: float) -> None:
    length_m = 157.0
    x, y, heading = Alignment([Element.from_radii(length_m, radius_m, radius_m)]).pose(length_m)
    angle = length_m / radius_m
    assert float(x) == pytest.approx(radius_m * math.sin(angle), abs=1e-9)
    # Right curves go south of a start towards east.
    assert float(y) == pytest.approx(-2.0 * radius_m * math.sin(angle / 2) ** 2, abs=1e-9)
    assert float(heading) == pytest.approx(-angle, abs=1e-12)


def test_full_circle_closes() -> None:
    circle = Alignment([Element.from_radii(2.0 * math.pi * 400.0, 400.0, 400.0)])
    x, y, heading = circle.pose(circle.length_m)
    assert abs(complex(x, y)) < 1e-9
    assert float(heading) == pytest.approx(-2.0 * math.pi)


def test_clothoid_turns_half_of_what_its_arc_would() -> None:
    clothoid = Alignment([Element.from_radii(90.0, None, 520.2)])
    assert float(clothoid.pose(90.0)[2]) == pytest.approx(-90.0 / (2 * 520.2), abs=1e-15)


def test_clothoid_from_straight_is_cornus_spiral() -> None:
    length_m, radius_m = 120.0, 240.0
    scale = math.sqrt(math.pi * length_m * radius_m)
    sine, cosine = fresnel(length_m / scale)
    x, y, _ = Alignment([Element.from_radii(length_m, None, -radius_m)]).pose(length_m)
    assert float(x) == pytest.approx(scale * cosine, abs=1e-10)
    assert float(y) == pytest.approx(scale * sine, abs=1e-10)


@pytest.mark.parametrize(
    ("length_m", "start_m", "end_m"),
    [
        (80.0, None, 300.0),
        (80.0, 300.0, None),
        (80.0, -850.0, -2600.0),  # two radii of the same sign
        (150.0, 300.0, -250.0),  # through the inflection
        (50.0, 3896.2, 6246.2),
        (1000.0, 400.0, 20.0),  # many turns
        (100.0, 300.0, 300.0000001),  # all but an arc: the Fresnel form would cancel
        (100.0, 300.0, 301.0),
        (100.0, 1e7, 2e6),
        (0.01, None, 500.0),
    ],
)
def test_clothoid_agrees_with_quadrature(
    length_m: float, start_m: float | None, end_m: float | None
) -> None:
    element = Element.from_radii(length_m, start_m, end_m)
    line = Alignment([element])
    for s in (0.013 * length_m, 0.5 * length_m, length_m):
        x, y, _ = line.pose(s)
        assert abs(complex(x, y) - integrated(element, s)) < 1e-8


def test_mirrored_alignment_is_mirrored() -> None:
    radii = [(100.0, None, 400.0), (80.0, 400.0, 400.0), (60.0, 400.0, -300.0)]
    right = Alignment([Element.from_radii(*r) for r in radii])
    left = Alignment([Element.from_radii(n, a and -a, b and -b) for n, a, b in radii])
    s = np.linspace(0.0, right.length_m, 50)
    np.testing.assert_allclose(right.pose(s)[0], left.pose(s)[0], atol=1e-10)
    np.testing.assert_allclose(right.pose(s)[1], -left.pose(s)[1], atol=1e-10)


def test_moved_is_a_rigid_motion() -> None:
    line = Alignment([Element.from_radii(100.0, None, 350.0), Element.from_radii(90.0, 350.0, 1e3)])
    moved = line.moved(1e4, -2e3, 2.0)
    s = np.linspace(0.0, line.length_m, 23)
    x, y, heading = line.pose(s)
    u, v, turned = moved.pose(s)
    expected = complex(1e4, -2e3) + (x + 1j * y) * np.exp(2.0j)
    np.testing.assert_allclose(u + 1j * v, expected, atol=1e-9)
    np.testing.assert_allclose(turned, heading + 2.0)


def test_curvature_is_linear_in_each_element() -> None:
    line = Alignment(
        [Element.from_radii(100.0, None, 500.0), Element.from_radii(50.0, -250.0, None)]
    )
    np.testing.assert_allclose(
        line.curvature_per_m([0.0, 50.0, 100.0, 125.0, 150.0]),
        [0.0, -1e-3, 4e-3, 2e-3, 0.0],
        atol=1e-18,
    )


@pytest.mark.parametrize("chainage_m", [-0.1, 100.1, math.nan, math.inf, [5.0, 101.0]])
def test_off_the_track_is_refused(chainage_m: float) -> None:
    with pytest.raises(ValueError, match="off the track"):
        Alignment([Element(100.0)]).pose(chainage_m)


@pytest.mark.parametrize(
    "elements",
    [[], [Element(0.0)], [Element(-1.0)], [Element(math.nan)], [Element(1.0, math.inf, 0.0)]],
)
def test_impossible_elements_are_refused(elements: list[Element]) -> None:
    with pytest.raises(ValueError, match=r"element"):
        Alignment(elements)


curvatures = st.floats(-1 / 50.0, 1 / 50.0) | st.just(0.0)
element_strategy = st.builds(Element, st.floats(0.5, 400.0), curvatures, curvatures) | st.builds(
    lambda n, k: Element(n, k, k), st.floats(0.5, 400.0), curvatures
)


@given(st.lists(element_strategy, min_size=1, max_size=12), st.floats(-math.pi, math.pi))
def test_any_alignment_is_continuous_and_of_unit_speed(
    elements: list[Element], heading_rad: float
) -> None:
    line = Alignment(elements, heading_rad=heading_rad)
    assert line.length_m == pytest.approx(sum(e.length_m for e in elements))
    step_m = 1e-3
    s = np.concatenate(
        (line.joints_m[1:-1] - step_m / 2, np.linspace(0, line.length_m - step_m, 40))
    )
    x0, y0, heading0 = line.pose(s)
    x1, y1, heading1 = line.pose(s + step_m)
    chord = (x1 - x0) + 1j * (y1 - y0)
    # The chord of a millimetre is as long as the arc and points along the mean heading.
    np.testing.assert_allclose(chord, step_m * np.exp(0.5j * (heading0 + heading1)), atol=2e-8)
    assert np.all(np.abs(heading1 - heading0) <= step_m / 50.0 + 1e-12)


@given(st.lists(element_strategy, min_size=1, max_size=6))
def test_polygon_through_the_curve_has_its_length(elements: list[Element]) -> None:
    line = Alignment(elements)
    s = np.linspace(0.0, line.length_m, 5_001)
    x, y, _ = line.pose(s)
    assert np.hypot(np.diff(x), np.diff(y)).sum() == pytest.approx(line.length_m, rel=1e-4)


@given(st.lists(element_strategy, min_size=1, max_size=6), st.floats(0.0, 1.0))
def test_one_point_is_as_good_as_many(elements: list[Element], part: float) -> None:
    line = Alignment(elements)
    s = np.array([0.0, part * line.length_m, line.length_m])
    together = np.array(line.pose(s))
    alone = np.array([line.pose(value) for value in s]).T
    np.testing.assert_allclose(together, alone, rtol=0, atol=1e-9)
