"""Packs: the same number of several recordings in one register, so that one instruction serves them all.

The compiler does loops over many drives at once only where nothing branches. The step of a drive with effects branches
everywhere, but mostly on its parameters, which recordings of one drive have in common. So a *pack* is a type of its own: where
a kernel is given packs instead of numbers, the same source is compiled for :data:`WIDTH` recordings. Sums, products and
functions are those of numbers, lane by lane, and round alike; a comparison of packs is a mask, on which a
kernel cannot branch. What says the same about numbers and packs:

* :func:`chosen` instead of ``a if condition else b``;
* :func:`anywhere` before a branch that some lane may need;
* :func:`leading` for what all lanes have in common;
* :func:`raised` for a flag in a workspace of either kind.

A :data:`workspace of packs <packs_at>` has the lanes of an entry side by side. Numbers are taken for packs with equal lanes.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.imputils import lower_builtin, lower_cast
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, models, overload, register_model

from flexdrive_gym.drive.compilation import OPTIONS

# four are what most processors do at once; of eight more would be idle where recordings end
WIDTH = 4

_NUMBERS = ir.VectorType(ir.DoubleType(), WIDTH)
_BITS = ir.VectorType(ir.IntType(1), WIDTH)
_ADDRESS = ir.DoubleType().as_pointer()


class Pack(types.Type):
    """One number per lane."""

    def __init__(self) -> None:
        super().__init__(name=f"pack_of_{WIDTH}")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:  # noqa: ARG002
        """Take numbers for packs."""
        return Conversion.safe if isinstance(other, types.Float | types.Integer) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """Return the type of what is a pack in one branch and maybe a number in another."""
        return self if self.can_convert_from(typingctx, other) is not None else None


class Mask(types.Type):
    """Yes or no per lane."""

    def __init__(self) -> None:
        super().__init__(name=f"mask_of_{WIDTH}")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:  # noqa: ARG002
        """Take one answer for all lanes."""
        return Conversion.safe if isinstance(other, types.Boolean) else None


class Packs(types.Type):
    """Where packs lie one after the other, lanes side by side."""

    def __init__(self) -> None:
        super().__init__(name=f"packs_of_{WIDTH}")


pack, mask, packs = Pack(), Mask(), Packs()


def _represented(kind: Any, by: Any) -> None:
    class Model(models.PrimitiveModel):
        def __init__(self, manager: Any, type_: Any) -> None:
            super().__init__(manager, type_, by)

    register_model(kind)(Model)


_represented(Pack, _NUMBERS)
_represented(Mask, _BITS)
_represented(Packs, _ADDRESS)


def _natural(i: int) -> Any:
    return ir.Constant(ir.IntType(32), i)


def _repeated(builder: Any, vector: Any, value: Any) -> Any:
    nothing = ir.Constant(vector, ir.Undefined)
    one = builder.insert_element(nothing, value, _natural(0))
    return builder.shuffle_vector(one, nothing, ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH))


def _in_all_lanes(context: Any, builder: Any, kind: Any, to: Any, value: Any) -> Any:  # noqa: ARG001
    return _repeated(builder, _NUMBERS, context.cast(builder, value, kind, types.float64))


def _for_all_lanes(context: Any, builder: Any, kind: Any, to: Any, value: Any) -> Any:  # noqa: ARG001
    return _repeated(builder, _BITS, context.cast(builder, value, kind, types.boolean))


lower_cast(types.Float, Pack)(_in_all_lanes)
lower_cast(types.Integer, Pack)(_in_all_lanes)
lower_cast(types.Boolean, Mask)(_for_all_lanes)


def _means(operation: Any, result: Any, kind: Any, arguments: int, code: Callable[[Any, tuple[Any, ...]], Any]) -> None:
    """Say what an operation on packs or masks compiles to."""

    class Template(ConcreteTemplate):
        cases = (signature(result, *[kind] * arguments),)

    infer_global(operation)(Template)

    def generate(context: Any, builder: Any, of: Any, values: Any) -> Any:  # noqa: ARG001
        return code(builder, values)

    lower_builtin(operation, *[kind] * arguments)(generate)


def _called(builder: Any, name: str, values: Any) -> Any:
    kind = ir.FunctionType(_NUMBERS, [_NUMBERS])
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{WIDTH}f64"), values)


def _size(builder: Any, values: tuple[Any, ...]) -> Any:
    return _called(builder, "fabs", values)


def _compares(sign: str) -> Callable[[Any, tuple[Any, ...]], Any]:
    # as with numbers, no comparison holds for what is not a number but that it differs
    kind = "fcmp_unordered" if sign == "!=" else "fcmp_ordered"
    return lambda builder, values: getattr(builder, kind)(sign, *values)


def _outermost(sign: str) -> Callable[[Any, tuple[Any, ...]], Any]:
    # in the order in which the compiler compares numbers: of equal ones the first
    return lambda builder, v: builder.select(builder.fcmp_ordered(sign, v[1], v[0]), v[1], v[0])


def _instruction(name: str) -> Callable[[Any, tuple[Any, ...]], Any]:
    return lambda builder, values: getattr(builder, name)(*values)


for _name, _code in (("add", "fadd"), ("sub", "fsub"), ("mul", "fmul"), ("truediv", "fdiv")):
    _means(getattr(operator, _name), pack, pack, 2, _instruction(_code))
    _means(getattr(operator, f"i{_name}"), pack, pack, 2, _instruction(_code))
for _name, _sign in (("lt", "<"), ("le", "<="), ("gt", ">"), ("ge", ">="), ("eq", "=="), ("ne", "!=")):
    _means(getattr(operator, _name), mask, pack, 2, _compares(_sign))
for _name in ("and_", "or_"):
    _means(getattr(operator, _name), mask, mask, 2, _instruction(_name))
    _means(getattr(operator, f"i{_name.rstrip('_')}"), mask, mask, 2, _instruction(_name))
_means(operator.neg, pack, pack, 1, _instruction("fneg"))
_means(operator.invert, mask, mask, 1, _instruction("not_"))
_means(abs, pack, pack, 1, _size)
_means(min, pack, pack, 2, _outermost("<"))
_means(max, pack, pack, 2, _outermost(">"))


def _place(builder: Any, base: Any, i: Any) -> Any:
    return builder.bitcast(builder.gep(base, [builder.mul(i, ir.Constant(i.type, WIDTH))]), _NUMBERS.as_pointer())


# what numpy allocates is aligned for numbers, not for packs
_ALIGNED = 8


def _spread(typing_context: Any, x: Any) -> Any:  # noqa: ARG001
    return pack(types.float64), lambda context, builder, of, a: _in_all_lanes(context, builder, of.args[0], pack, a[0])


def _read_code(typing_context: Any, base: Any, i: Any) -> Any:  # noqa: ARG001
    return pack(packs, types.intp), lambda _c, builder, _s, a: builder.load(_place(builder, *a), align=_ALIGNED)


def _write_code(typing_context: Any, base: Any, i: Any, value: Any) -> Any:  # noqa: ARG001
    def generate(context: Any, builder: Any, of: Any, a: Any) -> Any:  # noqa: ARG001
        builder.store(a[2], _place(builder, a[0], a[1]), align=_ALIGNED)
        return context.get_dummy_value()

    return types.none(packs, types.intp, pack), generate


def _packs_at(typing_context: Any, address: Any) -> Any:  # noqa: ARG001
    of: Any = types.CPointer
    return packs(of(types.float64)), lambda _c, _b, _s, a: a[0]


def _select_code(typing_context: Any, condition: Any, a: Any, b: Any) -> Any:  # noqa: ARG001
    return pack(mask, pack, pack), lambda _c, builder, _s, values: builder.select(*values)


def _floor_code(typing_context: Any, x: Any) -> Any:  # noqa: ARG001
    return pack(pack), lambda _c, builder, _s, a: _called(builder, "floor", a)


def _any_code(typing_context: Any, condition: Any) -> Any:  # noqa: ARG001
    def generate(context: Any, builder: Any, of: Any, a: Any) -> Any:  # noqa: ARG001
        bits = ir.IntType(WIDTH)
        return builder.icmp_unsigned("!=", builder.bitcast(a[0], bits), ir.Constant(bits, 0))

    return types.boolean(mask), generate


def _lane(typing_context: Any, x: Any, i: Any) -> Any:  # noqa: ARG001
    result = types.boolean if isinstance(x, Mask) else types.float64
    return result(x, types.intp), lambda _c, builder, _s, a: builder.extract_element(*a)


def _with_lane(typing_context: Any, x: Any, i: Any, value: Any) -> Any:  # noqa: ARG001
    return pack(pack, types.intp, types.float64), lambda _c, builder, _s, a: builder.insert_element(a[0], a[2], a[1])


def _numbers_of(typing_context: Any, base: Any) -> Any:  # noqa: ARG001
    of: Any = types.CPointer
    return of(types.float64)(packs), lambda _c, _b, _s, a: a[0]


_intrinsic: Any = intrinsic  # its own types say that what it makes returns nothing
_read: Any = _intrinsic(_read_code)
_write: Any = _intrinsic(_write_code)
_select: Any = _intrinsic(_select_code)
_any: Any = _intrinsic(_any_code)
_rounded_down: Any = _intrinsic(_floor_code)
# packs at a pointer to numbers, and back
packs_at: Callable[[Any], Any] = _intrinsic(_packs_at)
numbers_of: Callable[[Any], Any] = _intrinsic(_numbers_of)
# a pack with the same number in all lanes
spread: Callable[[float], Any] = _intrinsic(_spread)
# the number or the answer in one lane; a pack with another number there
lane: Callable[[Any, int], Any] = _intrinsic(_lane)
with_lane: Callable[[Any, int, float], Any] = _intrinsic(_with_lane)


def chosen(condition: Any, a: Any, b: Any) -> Any:
    """Return ``a`` where a condition holds, else ``b``; both are computed."""
    return a if condition else b


def anywhere(condition: Any) -> bool:
    """Return whether a condition holds in any lane."""
    return bool(condition)


def leading(x: Any) -> float:
    """Return the number in the first lane: that of all, of what they have in common."""
    return float(x)


def raised(z: Any, i: int) -> bool:
    """Return whether a flag of a workspace is set; flags are the same in all lanes."""
    return bool(z[i] > 0.0)


def _overload(function: Any, chooses: Callable[..., Any]) -> None:
    """Let the types of its arguments choose what a function compiles to."""
    # not strict, for what is compiled need not repeat the annotations of what chooses it
    options: Any = {**OPTIONS, "forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    overload(function, jit_options=options, strict=False)(chooses)


def _item(base: Any, i: Any) -> Any:  # noqa: ARG001
    return (lambda base, i: _read(base, i)) if isinstance(base, Packs) else None  # noqa: PLW0108


def _set_item(base: Any, i: Any, value: Any) -> Any:  # noqa: ARG001
    return (lambda base, i, value: _write(base, i, value)) if isinstance(base, Packs) else None  # noqa: PLW0108


def _chosen(condition: Any, a: Any, b: Any) -> Any:  # noqa: ARG001
    if isinstance(condition, Mask):
        return lambda condition, a, b: _select(condition, a, b)  # noqa: PLW0108
    return lambda condition, a, b: a if condition else b


def _anywhere(condition: Any) -> Any:
    if isinstance(condition, Mask):
        return lambda condition: _any(condition)  # noqa: PLW0108
    return lambda condition: condition


def _leading(x: Any) -> Any:
    return (lambda x: lane(x, 0)) if isinstance(x, Pack) else (lambda x: x)


def _raised(z: Any, i: Any) -> Any:  # noqa: ARG001
    # greater, because the compiler makes two branches of an equality that nan might enter
    return (lambda z, i: leading(z[i]) > 0.0) if isinstance(z, Packs) else (lambda z, i: z[i] > 0.0)


def _exponential(x: Any) -> Any:
    def each(x: Any) -> Any:
        y = x
        for i in range(WIDTH):
            y = with_lane(y, i, np.exp(lane(x, i)))
        return y

    return each if isinstance(x, Pack) else None


def _floor(x: Any) -> Any:
    return (lambda x: _rounded_down(x)) if isinstance(x, Pack) else None  # noqa: PLW0108


def _power(x: Any, exponent: Any) -> Any:
    def each(x: Any, exponent: Any) -> Any:
        y = x
        for i in range(WIDTH):
            y = with_lane(y, i, lane(x, i) ** exponent)
        return y

    return each if isinstance(x, Pack) and isinstance(exponent, types.Float) else None


_overload(operator.getitem, _item)
_overload(operator.setitem, _set_item)
_overload(operator.pow, _power)
_overload(chosen, _chosen)
_overload(anywhere, _anywhere)
_overload(leading, _leading)
_overload(raised, _raised)
_overload(np.exp, _exponential)
_overload(np.floor, _floor)
