"""Kernels that are compiled: where a measurement says that NumPy's calls cost more than the work.

A compiled kernel is written in plain Python on arrays and numbers. Its machine code is made at
the first call, kept in ``__pycache__`` beside the source, and found there by every later start.
``kernel.py_func`` is the pure form, which tests compare it with. Decision and measurements:
``docs/adr/0015-compiled-kernels.md``.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import pickle
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Decorator: compile a kernel, without the interpreter's lock while it runs.

    The arithmetic is IEEE 754 in the order written: no operation is contracted, reassociated or
    taken from another library, so a result is the same on every call, whatever the batch.
    Divisions by zero give inf or nan, as in NumPy.

    A kernel calls others by a global name of its module.
    """
    return cast(Function, Kernel(function))


def compiled_sums(function: Function) -> Function:
    """As `compiled`, for sums of products: in partial sums, products and additions at once.

    The number of terms alone tells the order, so a sum is the same on every call, wherever its
    terms lie and whatever else the batch holds. Another processor may round it otherwise, as
    products of matrices do.
    """
    return cast(Function, Kernel(function, fastmath={"reassoc", "contract"}))


class Kernel:
    """A kernel before its first call, which imports the compiler: that alone takes 0.4 s.

    Attributes
    ----------
    py_func : callable
        The pure form.
    """

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        assert isinstance(function, FunctionType)
        self.py_func = function
        self._options = options
        self._run: Callable[..., Any] = self._first_run
        functools.update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        """Run the machine code; the first call makes or loads it."""
        return self._run(*arguments)

    def _first_run(self, *arguments: Any) -> Any:
        self._run = self.machine_code
        answer = self._run(*arguments)
        if not self._called_as.is_file():
            import numba

            signature = tuple(numba.typeof(argument) for argument in arguments)
            with contextlib.suppress(OSError):
                self._called_as.write_bytes(pickle.dumps(signature))
        return answer

    def preload(self) -> bool:
        """Load the machine code that an earlier process has made, ahead of the first call.

        Returns
        -------
        bool
            False if no process has yet called the kernel; then nothing is done.
        """
        if not self._called_as.is_file():
            return False
        code: Any = self.machine_code
        try:
            code.compile(pickle.loads(self._called_as.read_bytes()))
        except (pickle.UnpicklingError, EOFError, AttributeError, ImportError):
            self._called_as.unlink(missing_ok=True)
            return False
        return True

    @functools.cached_property
    def machine_code(self) -> Callable[..., Any]:
        """The function of the compiler, also for the kernels that this one calls."""
        import numba

        # The compiler wants to see its own functions behind the names of those that are called.
        function = FunctionType(
            self.py_func.__code__,
            self.py_func.__globals__
            | {name: kernel.machine_code for name, kernel in self._called()},
            self.py_func.__name__,
        )
        function.__qualname__ = self.py_func.__qualname__
        # The compiler's own cache does not see a change in a kernel that is called by this one.
        of_user, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(self._folder)
        try:
            code: Callable[..., Any] = numba.njit(
                cache=True, nogil=True, error_model="numpy", **self._options
            )(function)
        finally:
            numba.config.CACHE_DIR = of_user
        return code

    def _called(self) -> Iterator[tuple[str, Kernel]]:
        """Kernels that this one calls, by their names in its module."""
        code = self.py_func.__code__
        names = self.py_func.__globals__
        for name in code.co_names:
            if isinstance(names.get(name), Kernel):
                yield name, names[name]

    @functools.cached_property
    def files(self) -> frozenset[str]:
        """Sources of this kernel and of those that it calls."""
        own = self.py_func.__code__.co_filename
        return frozenset({own}).union(*(kernel.files for _, kernel in self._called()))

    @functools.cached_property
    def _folder(self) -> Path:
        """Where the machine code is kept, another place for every state of the sources."""
        digest = hashlib.sha256()
        for path in sorted(self.files):
            digest.update(Path(path).read_bytes())
        beside = Path(self.py_func.__code__.co_filename).parent / "__pycache__"
        return cache_folder(beside) / f"kernels-{digest.hexdigest()[:16]}"

    @property
    def _called_as(self) -> Path:
        """Beside the machine code: with which types the first call was."""
        return self._folder / f"{self.py_func.__qualname__}.called_as"


def preload_kernels() -> int:
    """Load the machine code of the kernels of all modules imported so far; how many there were.

    What is loaded now need not be in the first tick.
    """
    modules = [module for module in list(sys.modules.values()) if module is not None]
    values = (value for module in modules for value in list(vars(module).values()))
    kernels = {id(value): value for value in values if type(value) is Kernel}
    return sum(kernel.preload() for kernel in kernels.values())


def cache_folder(beside: Path) -> Path:
    """A folder for what can be made again: the one asked for, the user's if that is read-only."""
    with contextlib.suppress(OSError):
        beside.mkdir(exist_ok=True)
    if os.access(beside, os.W_OK):
        return beside
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "rail_corridor"
