"""Kernels that are compiled: where a measurement says that NumPy's calls cost more than the work.

A compiled kernel is written in plain Python on arrays and numbers. Its machine code is made at
the first call, kept beside the source, and found there by every later start. ``kernel.py_func`` is
the pure form, which tests compare it with. Decision and measurements:
``docs/adr/0013-compiled-kernels.md``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

Kernel = TypeVar("Kernel", bound=Callable[..., Any])


def compiled(function: Kernel) -> Kernel:
    """Decorator: compile a kernel, without the interpreter's lock while it runs.

    The arithmetic is IEEE 754 in the order written: no operation is contracted, reassociated or
    taken from another library, so a result is the same on every call, whatever the batch.
    Divisions by zero give inf or nan, as in NumPy.
    """
    made: Kernel = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    return made
