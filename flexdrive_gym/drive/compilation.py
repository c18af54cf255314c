"""Compilation of the kernels: once, cached, and never stale.

The compiler's own cache notices a change only in the file of the function it compiled, not in what that function
calls. The kernels are chains over many files, so their cache lives in a directory named by a digest of all of them
(and of the compiler's version): a changed effect is always compiled anew, an unchanged one never.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import platformdirs
from numba.core import config as _config
from numba.core import types
from numba.core.registry import CPUDispatcher
from numba.extending import intrinsic

Function = TypeVar("Function", bound=Callable[..., Any])

# Contraction into fused multiply-adds or reassociation would let the batch differ from the single drive in the last
# bit, so floating point stays strict. Division by zero gives inf as in C: a guard would cost a branch per division.
OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "nogil": True}


def _digest() -> str:
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_directory() -> str:
    root = os.environ.get("FLEXDRIVE_CACHE_DIR") or platformdirs.user_cache_dir("flexdrive")
    return str(Path(root) / "kernels" / _digest())


CACHE_DIRECTORY = _cache_directory()


def compiled_before() -> bool:
    """Whether kernels of exactly this code are in the cache already, so that no compilation is due."""
    return any(Path(CACHE_DIRECTORY).rglob("*.nbi"))


class _Inner(CPUDispatcher):
    """What only compiled code calls compiled; from the interpreter it is the function that was written."""

    def __call__(self, *arguments: Any) -> Any:
        return self.py_func(*arguments)


def _inner(function: Function, *, forceinline: bool) -> Function:
    # a function that the interpreter could call takes as long again to compile, and none of these is called by it
    options = {**OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "forceinline": forceinline}
    done: Any = numba.njit(**options)(function)
    done.__class__ = _Inner
    return cast("Function", done)


def inlined(function: Function) -> Function:
    """Compile a function into its callers; a loop over such calls can be vectorised."""
    return _inner(function, forceinline=True)


def called(function: Function) -> Function:
    """Compile a long, rarely needed function that kernels call, without asking for it to be inlined.

    Said outright, because the compiler lets a callee inherit its caller's wish to be inlined.
    """
    return _inner(function, forceinline=False)


def _pointer(typing_context: Any, array: Any) -> Any:  # noqa: ARG001
    """Return the data pointer of a contiguous array, for the functions a kernel calls.

    Arrays are counted references: passing one into a function costs atomic counting in every step of a loop, more than
    the step itself. A pointer is not counted, so the kernel's caller must hold the array; it does, as the kernel's argument.
    """
    if isinstance(array, types.NoneType):
        return types.none(array), lambda context, builder, signature, arguments: context.get_dummy_value()  # noqa: ARG005

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.make_array(signature.args[0])(context, builder, arguments[0]).data

    of: Any = types.CPointer
    return of(array.dtype)(array), generate


def _shifted(typing_context: Any, base: Any, offset: Any) -> Any:  # noqa: ARG001
    """Return a pointer ``offset`` entries further on; nothing stays nothing."""
    if isinstance(base, types.NoneType):
        return types.none(base, types.intp), lambda context, builder, signature, arguments: context.get_dummy_value()  # noqa: ARG005

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        return builder.gep(arguments[0], [arguments[1]])

    return base(base, types.intp), generate


def _fused(typing_context: Any, a: Any, b: Any, c: Any) -> Any:  # noqa: ARG001
    """Return a·b + c, rounded once: said outright it is the same in vector and scalar code, unlike contraction."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), generate


def _pointer_to(kind: Any) -> Any:
    def at(typing_context: Any, address: Any) -> Any:  # noqa: ARG001
        of: Any = types.CPointer
        signature = of(kind)(types.intp)

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

        return signature, generate

    return _intrinsic(at)


_intrinsic: Any = intrinsic  # its own types say that what it makes returns nothing
pointer: Callable[[Any], Any] = _intrinsic(_pointer)
shifted: Callable[[Any, int], Any] = _intrinsic(_shifted)
fused: Callable[[float, float, float], float] = _intrinsic(_fused)
# pointers from the addresses of arrays that the caller holds: one argument for many arrays, whose unpacking at every call
# would take longer than a step
floats_at: Callable[[int], Any] = _pointer_to(types.float64)
singles_at: Callable[[int], Any] = _pointer_to(types.float32)
integers_at: Callable[[int], Any] = _pointer_to(types.int64)
naturals_at: Callable[[int], Any] = _pointer_to(types.uint64)
flags_at: Callable[[int], Any] = _pointer_to(types.uint8)


def _cached(function: Function, options: dict[str, Any]) -> Function:
    config: Any = _config
    previous = config.CACHE_DIR
    config.CACHE_DIR = CACHE_DIRECTORY
    try:
        done: Function = numba.njit(cache=True, **options)(function)
    finally:
        config.CACHE_DIR = previous
    return done


def kernel(function: Function) -> Function:
    """Compile an entry point, cached on disk under the digest of all kernel sources."""
    return _cached(function, OPTIONS)


def kernel_holding_lock(function: Function) -> Function:
    """Compile an entry point that is over sooner than the interpreter's lock could be released and taken again."""
    return _cached(function, {**OPTIONS, "nogil": False})


def entry(function: Any, *arguments: Any) -> Callable[..., Any]:
    """Return a kernel's compiled code for arguments like these; called directly it costs a third of what dispatch does."""
    typeof: Any = numba.typeof
    signature = tuple(typeof(argument) for argument in arguments)
    function.compile(signature)
    code: Callable[..., Any] = function.get_overload(signature)
    return code
