"""Loops over plain arrays, compiled by numba where the extra ``fast`` is installed.

numpy stays the road of every formula. A kernel is a second one for what numpy does slowly (many
small problems, loops that depend on their last step) and must give the same numbers to rounding.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable
from functools import cache, cached_property, update_wrapper
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType
from typing import Any, Generic, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

#: Loading a kernel from the disk takes about as long, and numba before it twice that. [s]
_WORTH_LOADING = 0.25


#: Without Python's lock; divided by zero is infinite, as in numpy: no test at every division.
_HOW = {"nogil": True, "error_model": "numpy"}


class Kernel(Generic[P, T]):
    """A function that numba compiles when it is first called; without numba, the function itself.

    The machine code is kept on the disk beside the module, or in the user's cache. It runs without
    Python's lock, so threads run it side by side.

    Parameters
    ----------
    function : callable
        Of arrays and numbers, in the part of Python and numpy that numba knows. The copy on the
        disk is renewed when its module changes, or that of a kernel that it calls.
    plain : callable, optional
        The same as numpy does it well, where a loop is too slow without numba.
    inline : bool
        Whether callers take in the machine code instead of calling it.

    Attributes
    ----------
    plain : callable
        What is called without numba: by default the function as it was written, with the plain
        ones of the kernels that it calls.

    Examples
    --------
    >>> @compiled
    ... def total(numbers):
    ...     sum_ = 0.0
    ...     for number in numbers:
    ...         sum_ += number
    ...     return sum_
    >>> total.plain([1.0, 2.5])
    3.5
    """

    def __init__(
        self, function: Callable[P, T], plain: Callable[P, T] | None = None, *, inline: bool = False
    ) -> None:
        self._written, self._numpy = function, plain
        self._how = _HOW | {"forceinline": True} if inline else _HOW
        self._run: Callable[P, T] | None = None
        self._spent = 0.0
        update_wrapper(self, function)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> T:
        """Return what the function returns, from machine code where there is numba."""
        try:
            return self.machine_code()(*args, **kwargs)
        except OSError:  # a full disk does not take the machine code: do without a copy of it
            self._run = self._uncached()
            return self._run(*args, **kwargs)

    def pays(self, seconds: float) -> bool:
        """Return whether to call this rather than go the road of numpy.

        Parameters
        ----------
        seconds : float
            What the road of numpy would take now, roughly. It adds up over the calls: one small
            problem is not worth loading numba for, thousands are.

        Returns
        -------
        pays : bool
            False without numba.
        """
        if self._run is None:
            self._spent += seconds
            if self._spent < _WORTH_LOADING:
                return False
        return _numba() is not None

    @cached_property
    def plain(self) -> Callable[P, T]:
        """The function without numba."""
        return self._numpy or self._bound(lambda kernel: kernel.plain)

    def machine_code(self) -> Callable[P, T]:
        """Return the compiled function, which other kernels may call."""
        if self._run is None:
            self._run = self._made()
        return self._run

    def _made(self) -> Callable[P, T]:
        numba = _numba()
        if numba is None:
            return self.plain
        bound = self._bound(lambda kernel: kernel.machine_code())
        try:
            return numba.njit(cache=True, **self._how)(bound)
        except RuntimeError:  # neither the module's folder nor the user's cache may be written
            return self._uncached()

    def _uncached(self) -> Any:
        numba = _numba()
        return numba.njit(**self._how)(self._bound(lambda kernel: kernel._uncached()))

    def _bound(self, made: Callable[[Any], Any]) -> Any:
        """Return the function with what is made of the kernels that it calls in their place."""
        written: Any = self._written
        code, names = written.__code__, dict(written.__globals__)
        for name in code.co_names:
            if isinstance(names.get(name), Kernel):
                names[name] = made(names[name])
        function = FunctionType(code, names, code.co_name, written.__defaults__)
        # numba looks at this module alone: the others go into the name that the copy is kept under.
        others = sorted(filter(os.path.isfile, self._modules() - {code.co_filename}))
        if others:
            read = b"".join(Path(path).read_bytes() for path in others)
            function.__qualname__ += f"-{zlib.crc32(read):08x}"
        return function

    def _modules(self) -> set[str]:
        """Return the files of this kernel and of all that it calls."""
        written: Any = self._written
        known = (written.__globals__.get(name) for name in written.__code__.co_names)
        called = (kernel._modules() for kernel in known if isinstance(kernel, Kernel))
        return {written.__code__.co_filename}.union(*called)


def inlined(function: Callable[P, T]) -> Kernel[P, T]:
    """Return a few sums as a `Kernel` whose machine code stands inside that of its callers."""
    return Kernel(function, inline=True)


def compiled(function: Callable[P, T]) -> Kernel[P, T]:
    """Return a function as a `Kernel`; the decorator."""
    return Kernel(function)


@cache
def _numba() -> Any:
    """Return numba; None where it is absent, switched off or refuses the numpy installed."""
    if find_spec("numba") is None or os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        return None
    try:
        import numba
    except ImportError:
        return None
    return numba
