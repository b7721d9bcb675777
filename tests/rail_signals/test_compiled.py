"""Kernels: compiled at the first call, found again by the next process, made anew when changed."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from rail_signals.compiled import Kernel, cache_folder, compiled_sums, preload_kernels

INNER = """
from rail_signals.compiled import compiled

@compiled
def inner(x):
    return {factor} * x
"""
OUTER = """
from kernels_inner import inner
from rail_signals.compiled import compiled

@compiled
def outer(x, y):
    return inner(x) + y
"""
Process = Callable[[float], ModuleType]


@pytest.fixture
def process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Process]:
    """Return what imports two modules of kernels as a process would that has just begun."""
    monkeypatch.syspath_prepend(tmp_path)
    names = ("kernels_inner", "kernels_outer")

    def begin(factor: float) -> ModuleType:
        for name, text in zip(names, (INNER.format(factor=factor), OUTER), strict=True):
            (tmp_path / f"{name}.py").write_text(text)
        made: Any = None
        for name in names:
            spec = importlib.util.spec_from_file_location(name, tmp_path / f"{name}.py")
            assert spec and spec.loader
            made = importlib.util.module_from_spec(spec)
            sys.modules[name] = made
            # Not from the byte code of a file that was written within the same second.
            exec(
                compile((tmp_path / f"{name}.py").read_text(), spec.origin or "", "exec"),
                vars(made),
            )
        return made

    yield begin
    for name in names:
        sys.modules.pop(name, None)


def kernel(function: Any) -> Kernel:
    assert isinstance(function, Kernel)
    return function


def test_a_kernel_is_what_its_pure_form_is(process: Process) -> None:
    outer = kernel(process(2.0).outer)
    assert outer(1.5, 1.0) == outer.py_func(1.5, 1.0) == 4.0
    assert outer(1.5, 2.0) == 5.0


def test_the_next_process_loads_what_was_called_before_its_first_call(process: Process) -> None:
    before = kernel(process(2.0).outer)
    assert not before.preload()
    before(1.5, 1.0)
    after = kernel(process(2.0).outer)
    assert after.preload()
    code: Any = after.machine_code
    assert len(code.signatures) == 1
    assert after(1.5, 1.0) == 4.0
    assert sum(code.stats.cache_hits.values()) == 1
    assert sum(code.stats.cache_misses.values()) == 0
    assert preload_kernels() >= 1


def test_a_change_in_a_kernel_that_is_called_is_seen(process: Process) -> None:
    assert kernel(process(2.0).outer)(1.5, 1.0) == 4.0
    changed = kernel(process(3.0).outer)
    assert not changed.preload()
    assert changed(1.5, 1.0) == 5.5


def test_one_that_was_called_by_another_notes_its_own_first_call(process: Process) -> None:
    process(2.0).outer(1.5, 1.0)
    inner = kernel(sys.modules["kernels_inner"].inner)
    assert not inner.preload()  # nobody has called it by itself
    assert inner(2.0) == 4.0
    process(2.0)
    assert kernel(sys.modules["kernels_inner"].inner).preload()


def test_a_damaged_note_is_forgotten(process: Process, tmp_path: Path) -> None:
    kernel(process(2.0).outer)(1.5, 1.0)
    (note,) = tmp_path.rglob("outer.called_as")
    note.write_bytes(b"")
    outer = kernel(process(2.0).outer)
    assert not outer.preload()
    assert not note.exists()
    assert outer(1.5, 1.0) == 4.0


def test_where_the_sources_cannot_be_written_the_user_has_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cache_folder(tmp_path / "made") == tmp_path / "made"
    monkeypatch.setattr("os.access", lambda path, mode: False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder(tmp_path / "made") == tmp_path / "rail_corridor"


def test_a_sum_is_the_same_wherever_its_terms_lie() -> None:
    @compiled_sums
    def total(values: Any, first: Any, count: Any) -> Any:
        found = np.float32(0.0)
        for i in range(count):
            found += values[first + i]
        return found

    values = np.random.default_rng(6).normal(size=101).astype(np.float32)
    wanted = total(values, 0, 101)
    assert wanted == pytest.approx(np.sum(values.astype(np.float64)), abs=1e-4)
    for shift in range(20):
        many = np.full(140, 1e9, dtype=np.float32)
        many[shift : shift + 101] = values
        assert total(many, shift, 101) == wanted
