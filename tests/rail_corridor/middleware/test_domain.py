"""Two corridors in one ROS domain are refused before anything starts."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest

from rail_corridor.errors import InputError
from rail_corridor.middleware.domain import free_domain, is_held, sole_corridor


@pytest.fixture(autouse=True)
def _domain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")


@pytest.mark.parametrize("first", [None, "wayside", "onboard"])
@pytest.mark.parametrize("second", [None, "wayside", "onboard"])
def test_what_may_run_side_by_side(tmp_path: Path, first: str | None, second: str | None) -> None:
    with sole_corridor(first, tmp_path):
        if None in (first, second) or first == second:
            line = "ROS_DOMAIN_ID: 7: a corridor is running in this domain already"
            with pytest.raises(InputError, match=line), sole_corridor(second, tmp_path):
                pass
        else:
            with sole_corridor(second, tmp_path):
                pass
    with sole_corridor(second, tmp_path):
        pass  # free again


def test_another_domain_is_free(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with sole_corridor(None, tmp_path):
        monkeypatch.setenv("ROS_DOMAIN_ID", "8")
        with sole_corridor(None, tmp_path):
            pass


@pytest.mark.parametrize("part", [None, "wayside", "onboard"])
def test_whether_a_domain_is_held(tmp_path: Path, part: str | None) -> None:
    assert not is_held(tmp_path)
    with sole_corridor(part, tmp_path):
        assert is_held(tmp_path)
        # Looking does not stand in the way of the other part.
        with sole_corridor("onboard" if part == "wayside" else "report", tmp_path):
            pass
    assert not is_held(tmp_path)


def test_free_domains_are_different_ones_until_none_is_left(tmp_path: Path) -> None:
    with ExitStack() as held:
        domains = {held.enter_context(free_domain(None, tmp_path)) for _ in range(91)}
        assert domains == {*range(10, 101)}
        with pytest.raises(InputError, match="domain: 'any': a corridor is running"):
            held.enter_context(free_domain(None, tmp_path))
        (one,) = list(domains)[:1]
        with pytest.raises(InputError, match=f"domain: {one}: a corridor is running"):
            held.enter_context(free_domain(one, tmp_path))
    with free_domain(one, tmp_path) as again:
        assert again == one
