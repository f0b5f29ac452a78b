"""Compilation by LLVM of a whole program, instead of each function by itself.

Numba would make machine code of every function with all its callees, although most are never called
from outside: a whole program takes a fifth of that time. This relies on private names of Numba, of
which `tests/compiled` notices changes.
"""

import gc
from typing import Any, cast

from llvmlite import binding as llvm
from numba.core import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

_LEVEL = 1
"""LLVM's level of optimisation; more takes longer and gains nothing here."""


class PartCompiler(Compiler):
    """Compiler of a function that becomes machine code as a part of its callers."""

    def define_pipelines(self) -> Any:
        """Select Numba's own passes, into a library without machine code."""
        _use(self, _Part)
        return super().define_pipelines()


class WholeCompiler(Compiler):
    """Compiler of a function that Python calls, together with its parts."""

    def compile_extra(self, func: Any) -> Any:
        """Compile without garbage collection, which takes a fifth of the time and finds nothing."""
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(func)
        finally:
            if collects:
                gc.enable()

    def define_pipelines(self) -> Any:
        """Select Numba's own passes, into a library that is optimised as a whole."""
        _use(self, _Whole)
        return super().define_pipelines()


def compile_once_for_all_numbers(function: Any) -> None:
    """Keep Numba from compiling a function for each literal whole number in a call."""
    resolve = function.get_call_template

    def resolve_any(args: Any, kws: Any) -> Any:
        named = {name: types.unliteral(kind) for name, kind in kws.items()}
        return resolve([types.unliteral(kind) for kind in args], named)

    function.get_call_template = resolve_any


def _use(compiler: Any, kind: type[JITCodeLibrary]) -> None:
    state = compiler.state
    state.library = kind(state.targetctx.codegen(), state.func_id.func_qualname)
    state.library.enable_object_caching()


class _NoEnvironment:
    """Receiver of a function's environment, of which a part has no use."""

    def set_env(self, name: str, environment: object) -> None:
        pass


class _Part(JITCodeLibrary):
    """LLVM's code of one function, not optimised."""

    @property
    def codegen(self) -> Any:
        return _NoEnvironment()

    def add_llvm_module(self, ll_module: Any) -> None:
        self._final_module.link_in(ll_module)

    def finalize(self) -> None:
        self._raise_if_finalized()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        del name  # A part has no machine code of its own.
        return 0


class _Whole(JITCodeLibrary):
    """Machine code of one function and all its parts."""

    def add_llvm_module(self, ll_module: Any) -> None:
        self._final_module.link_in(ll_module)

    def finalize(self) -> None:
        self._linking_libraries = _with_parts(self._linking_libraries)
        super().finalize()

    def _optimize_final_module(self) -> None:
        for library in self._linking_libraries:
            if isinstance(library, _Part):
                for function in library._final_module.functions:
                    if not function.is_declaration:
                        # Without other callers it may become part of its only one.
                        self._final_module.get_function(function.name).linkage = "internal"
        tuning = llvm.create_pipeline_tuning_options(speed_level=_LEVEL)
        tuning.loop_vectorization = True
        machine = cast("Any", self._codegen)._tm
        builder = llvm.create_pass_builder(machine, tuning)
        builder.getModulePassManager().run(self._final_module, builder)


def _with_parts(libraries: list[Any]) -> list[Any]:
    """List libraries, and those that the parts among them need, each once."""
    found: dict[Any, None] = {}
    left = list(libraries)
    while left:
        library = left.pop()
        if library not in found:
            found[library] = None
            if isinstance(library, _Part):
                left += cast("Any", library)._linking_libraries
    return list(found)
