"""`compiled` and `part`: decorators that turn functions of arrays and numbers into machine code.

Numba would make machine code of every function with all its callees, although most are never called
from outside: a whole program takes a fifth of that time. This relies on private names of Numba, of
which `tests/compiled` notices changes.
"""

import gc
import hashlib
import inspect
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any, ParamSpec, TypeVar, cast

import numba
from llvmlite import binding as llvm
from numba.core import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature

from poise._compiled._kept_code import KeptCode

P = ParamSpec("P")
R = TypeVar("R")

_OPTIONS = {
    # Freedoms that let sums run in vector registers; NaN and infinity keep their meaning.
    "fastmath": {"reassoc", "contract", "nsz", "arcp"},
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    # Owners of arrays are not counted.
    "_nrt": False,
}
"""For all functions; none of them may make an array."""

_DISABLED = bool(cast("Any", numba).config.DISABLE_JIT)
"""Everything runs as plain Python with NUMBA_DISABLE_JIT."""

_COMPILER = b"".join(
    (Path(__file__).parent / f"{name}.py").read_bytes() for name in ("_blocks", "_compiling")
)
"""Sources on which all machine code depends."""


def compiled(function: Callable[P, R], *, nogil: bool = False) -> Callable[P, R]:
    """Compile a function at its first call, and keep the machine code on disk for later runs.

    Compiled functions may call each other. Kept code is recompiled when the file of a function
    changes, or that of any compiled function or a number that its file imports. Where it cannot be
    kept, every process makes its own.
    """
    dispatcher = _dispatcher(function, pipeline_class=_WholeCompiler, nogil=nogil)
    if not _DISABLED:
        # Without a folder to keep it in, as for a package that lies in an archive, it is not kept.
        with suppress(RuntimeError):
            dispatcher._cache = KeptCode(dispatcher.py_func, dispatcher.stamp)
    return dispatcher


def compiled_for_threads(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a long function that lets Python's other threads run.

    At its end it may have to wait for them, so it is not for a control loop.
    """
    return compiled(function, nogil=True)


def part(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function as a part of the compiled functions that call it.

    Calling it from Python ends the process.
    """
    dispatcher = _dispatcher(function, pipeline_class=_PartCompiler, no_cpython_wrapper=True)
    if not _DISABLED:
        resolve = dispatcher.get_call_template

        def resolve_any(args: Any, kws: Any) -> Any:
            # Numba would compile the function for each literal whole number in a call.
            named = {name: types.unliteral(kind) for name, kind in kws.items()}
            return resolve([types.unliteral(kind) for kind in args], named)

        dispatcher.get_call_template = resolve_any
    return dispatcher


def _dispatcher(function: Callable[..., Any], **options: Any) -> Any:
    # Tests wrap functions in checks of their annotations, which cannot be compiled.
    plain = cast("FunctionType", inspect.unwrap(function))
    if _DISABLED:
        return plain
    dispatcher = cast("Any", numba).njit(**_OPTIONS, **options)(plain)
    dispatcher.stamp = _stamp(plain)
    return dispatcher


def _stamp(plain: FunctionType) -> str:
    """Digest of the source that a function is compiled from, callees in other files included."""
    file = plain.__code__.co_filename
    digest = _digest_of(file, Path(file).stat().st_mtime_ns).copy()
    for name, value in sorted(plain.__globals__.items()):
        # Functions and blocks have a stamp of their own.
        known = value if isinstance(value, int | float | tuple) else getattr(value, "stamp", None)
        # A named tuple is handed over by the order of its fields.
        known = getattr(value, "_fields", known) if known is None else known
        if isinstance(known, int | float | str | tuple):
            digest.update(f"{name}={known!r};".encode())
    return digest.hexdigest()


@cache
def _digest_of(file: str, changed: int) -> Any:
    """Digest of a source and of the compiler."""
    del changed  # A file that was edited meanwhile is read again.
    return hashlib.sha256(_COMPILER + Path(file).read_bytes())


# --- calls by address ---------------------------------------------------------------------------


def address_of(function: Callable[..., Any]) -> int:
    """Return the address of the machine code of a compiled function that was called before."""
    if _DISABLED:
        return 0
    (found,) = cast("Any", function).overloads.values()
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_func_name))


def call_at(address: int, function: Callable[..., R], *args: Any) -> R:
    """Call a compiled function by its address, so that the caller does not contain its code."""
    del address  # In plain Python.
    return function(*args)


@cast("Any", infer_global)(call_at)
class _CallAt(AbstractTemplate):
    def generic(self, args: Any, _kws: Any) -> Any:
        _, function, *given = args
        found = function.get_call_type(self.context, given, {})
        return signature(found.return_type, types.int64, function, *found.args)


@lower_builtin(call_at, types.VarArg(types.Any))
def _(context: Any, builder: Any, sig: Any, values: Any) -> Any:
    call, result, kinds = context.call_conv, sig.return_type, sig.args[2:]
    pointer = call.get_function_type(result, kinds).as_pointer()
    code = builder.inttoptr(values[0], pointer)
    return call.call_function(builder, code, result, kinds, values[2:])[1]


# --- compilation of a whole program -------------------------------------------------------------


class _PartCompiler(Compiler):
    """Numba's own passes, into a library without machine code."""

    def define_pipelines(self) -> Any:
        _use(self, _Part)
        return super().define_pipelines()


class _WholeCompiler(Compiler):
    """Numba's passes, into a library that is optimised as one unit."""

    def compile_extra(self, func: Any) -> Any:
        # Garbage collection takes a fifth of the time and finds nothing.
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(func)
        finally:
            if collects:
                gc.enable()

    def define_pipelines(self) -> Any:
        _use(self, _Whole)
        return super().define_pipelines()


def _use(compiler: Any, kind: type[JITCodeLibrary]) -> None:
    state = compiler.state
    state.library = kind(state.targetctx.codegen(), state.func_id.func_qualname)
    state.library.enable_object_caching()


class _NoEnvironment:
    """Receiver of a function's environment, of which a part has no use."""

    def set_env(self, name: str, environment: object) -> None:
        pass


class _Part(JITCodeLibrary):
    """LLVM's code of one function, not optimised and without machine code."""

    @property
    def codegen(self) -> Any:
        return _NoEnvironment()

    def add_llvm_module(self, ll_module: Any) -> None:
        self._final_module.link_in(ll_module)

    def finalize(self) -> None:
        self._raise_if_finalized()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        del name
        return 0


class _Whole(JITCodeLibrary):
    """Machine code of one function and all its parts."""

    def add_llvm_module(self, ll_module: Any) -> None:
        self._final_module.link_in(ll_module)

    def finalize(self) -> None:
        # Libraries, and those that the parts among them need, each once.
        found: dict[Any, None] = {}
        left = list(self._linking_libraries)
        while left:
            library = left.pop()
            if library not in found:
                found[library] = None
                left += library._linking_libraries if isinstance(library, _Part) else ()
        self._linking_libraries = list(found)
        super().finalize()

    def _optimize_final_module(self) -> None:
        for library in self._linking_libraries:
            if isinstance(library, _Part):
                for function in library._final_module.functions:
                    if not function.is_declaration:
                        # Without other callers it may become part of its only one.
                        self._final_module.get_function(function.name).linkage = "internal"
        # A higher level takes longer and gains nothing here.
        tuning = llvm.create_pipeline_tuning_options(speed_level=1)
        tuning.loop_vectorization = True
        machine = cast("Any", self._codegen)._tm
        builder = llvm.create_pass_builder(machine, tuning)
        builder.getModulePassManager().run(self._final_module, builder)
