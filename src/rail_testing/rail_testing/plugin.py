"""The pytest plug-in: the fixture ``corridor``, the marker ``rail``, and what a failure leaves.

    @pytest.mark.rail(seeds=range(5), placements=["one", "site"])
    def test_mine(corridor):
        c = corridor("located_block")
        ...

Whatever a test has started ends with it. A failed test keeps a recording of all but waveforms and
says tick, seed, what nodes last said, and how to repeat it. With ``repeat=True`` a test runs twice,
and fails if the two runs differ, naming the first difference.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest

if TYPE_CHECKING:  # the rest of the corridor is loaded by the first test that needs it
    from .corridor import Corridor

_MARKER = "rail(seeds=None, placements=None, repeat=False): seeds and placements to run a test with"


class _Variant(NamedTuple):
    """What the marker says of one run of a test."""

    seed: int | None = None
    placement: str | None = None


class CorridorFactory:
    """Makes corridors, and closes them with the test: the fixture ``corridor``.

    Parameters
    ----------
    directory : Path
        For recordings of what fails.
    variant : _Variant
    """

    def __init__(self, directory: Path, variant: _Variant) -> None:
        self._directory, self._variant = directory, variant
        self.made: list[Corridor] = []

    def __call__(self, scenario: Any, **arguments: Any) -> Corridor:
        """A corridor; arguments as of `Corridor`. What the marker says goes before."""
        from .corridor import Corridor

        if self._variant.seed is not None:
            arguments["seed"] = self._variant.seed
        if self._variant.placement is not None:
            arguments["placement"] = self._variant.placement
        number = f"_{len(self.made)}" if self.made else ""
        arguments.setdefault("recording", self._directory / f"corridor{number}.mcap")
        self.made.append(Corridor(scenario, **arguments))
        return self.made[-1]

    def close(self) -> None:
        """End all of them."""
        for each in self.made:
            each.close()


def pytest_configure(config: pytest.Config) -> None:
    """Tell pytest of the marker."""
    config.addinivalue_line("markers", _MARKER)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run a test with every seed and placement of its marker."""
    asked = _asked_of(metafunc.definition)
    if not asked or "_rail_variant" not in metafunc.fixturenames:
        return
    seeds = list(asked.get("seeds") or [None])
    placements = list(asked.get("placements") or [None])
    variants = [_Variant(*both) for both in itertools.product(seeds, placements)]
    if variants == [_Variant()]:
        return
    names = ["-".join(str(part) for part in each if part is not None) for each in variants]
    metafunc.parametrize("_rail_variant", variants, ids=names, indirect=True)


def _asked_of(item: Any) -> dict[str, Any]:
    """What the markers of a test and of its class say together; the nearest one counts.

    Raises
    ------
    UsageError
        For what the marker does not take.
    """
    asked: dict[str, Any] = {}
    for marker in reversed(list(item.iter_markers("rail"))):
        unknown = marker.kwargs.keys() - {"seeds", "placements", "repeat"}
        if unknown or marker.args or isinstance(marker.kwargs.get("seeds"), int):
            raise pytest.UsageError(f"{item.nodeid}: the marker is {_MARKER}")
        asked |= marker.kwargs
    return asked


@pytest.fixture
def _rail_variant(request: pytest.FixtureRequest) -> _Variant:
    return getattr(request, "param", _Variant())


@pytest.fixture
def corridor(tmp_path: Path, _rail_variant: _Variant) -> Iterator[CorridorFactory]:
    """Return a function that makes corridors; whatever they have started ends with the test."""
    factory = CorridorFactory(tmp_path, _rail_variant)
    yield factory
    factory.close()


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> Generator[None, Any, Any]:
    """Run a test that is marked so a second time, and compare."""
    answer = yield
    factory = _factory_of(pyfuncitem)
    for each in [] if factory is None else factory.made:
        each.conclude()
    if factory is None or not _asked_of(pyfuncitem).get("repeat"):
        return answer
    from .repeatability import first_difference

    before = [each.histories for each in factory.made]
    factory.close()
    factory.made.clear()
    arguments = {name: pyfuncitem.funcargs[name] for name in pyfuncitem._fixtureinfo.argnames}
    pyfuncitem.obj(**arguments)
    if len(before) != len(factory.made):
        pytest.fail(f"two runs differ: {len(before)} corridors, then {len(factory.made)}")
    for histories, other in zip(before, factory.made, strict=True):
        difference = first_difference(histories, other.histories)
        if difference is not None:
            pytest.fail(f"two runs differ, so something is not repeatable: {difference}")
    return answer


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add to the report of a failed test what is known of its corridors."""
    report = yield
    factory = _factory_of(item)
    if report.when == "call" and report.failed and factory is not None:
        for each in factory.made:
            report.sections.append(("corridor", _said(each, item)))
    return report


def _factory_of(item: pytest.Item) -> CorridorFactory | None:
    found = getattr(item, "funcargs", {}).get("corridor")
    return found if isinstance(found, CorridorFactory) else None


def _said(corridor: Corridor, item: pytest.Item) -> str:
    lines = [corridor.last_seen()]
    try:
        kept = corridor.keep_recording()
    except OSError as error:
        lines.append(f"no recording: {error}")
    else:
        if kept is not None:
            lines.append(f"recording: {kept}")
    # Where tests are divided among workers, the name ends with the group of the test.
    name = item.nodeid.rpartition("@")[0] if item.get_closest_marker("xdist_group") else ""
    lines.append(f"again: {sys.executable} -m pytest '{name or item.nodeid}'")
    return "\n".join(lines)
