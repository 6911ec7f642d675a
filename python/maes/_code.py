"""What stands for the code of a controller in the ids of its runs.

It covers the class with its bases, and the functions, classes and constants that these name, in
their own module, closures and other modules; a module that a function imports counts as a file. It
does not cover installed packages, names that are looked up as texts, and other files. Comments,
docstrings and line numbers do not count; the version of Python does, which compiles the code.

What code changes while it runs counts with the value with which it is first met: lists,
dictionaries, sets, arrays, the attributes of objects, and those of classes that their methods set.
"""

from __future__ import annotations

import dis
import enum
import functools
import hashlib
import importlib.util
import sys
import sysconfig
from collections import deque
from collections.abc import Mapping
from pathlib import Path, PurePath
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any, NamedTuple

import numpy as np

_PLAIN = (bool, int, float, complex, str, bytes, range, type(None), type(...))
_CONTAINERS = (list, dict, set, bytearray, deque, np.ndarray)
_METHODS = (FunctionType, staticmethod, classmethod, property, functools.cached_property)
# What Python puts into a class by itself.
_OF_PYTHON = ("__annotate__", "__annotate_func__", "_abc_impl")
_INSTALLED = {"site-packages", "dist-packages"}
# Flags of code with *arguments and **keys.
_VARIADIC = 0x0C

# By identity, which the kept object secures, and name: the digest with which it was first met.
_first_met: dict[tuple[int, str], tuple[Any, bytes]] = {}


def code_of(controller: type, *, is_copy_equal: bool = False) -> str:
    """What stands for the code of a class, hexadecimal: equal for equal code in every process of a
    version of Python. With `is_copy_equal` what code changes while it runs is left out, which copies
    of a class that has been used do not have in common."""
    walk = _Walk(not is_copy_equal)
    walk.add(sys.version_info[:2])
    walk.add(controller)
    return walk.digest().hex()


class _Code(NamedTuple):
    """What is read of a code object."""

    digest: bytes
    constants: tuple[Any, ...]
    # Names that are looked up in the module or in the functions around, each with its attributes.
    of_module: tuple[tuple[str, ...], ...]
    of_closure: tuple[tuple[str, ...], ...]
    # Attributes that are set, of whatever object.
    attributes: frozenset[str]
    # Names of modules that are imported, relative ones with their dots.
    imports: tuple[str, ...]


class _Hash:
    def __init__(self) -> None:
        self._hash = hashlib.blake2b(digest_size=16)

    def note(self, *words: object) -> None:
        for word in words:
            text = word if isinstance(word, bytes) else str(word).encode("utf-8", "surrogatepass")
            self._hash.update(len(text).to_bytes(8, "little") + text)

    def digest(self) -> bytes:
        return self._hash.digest()


@functools.lru_cache(4096)
def _read(code: CodeType) -> _Code:
    hashed = _Hash()
    arguments = (code.co_posonlyargcount, code.co_argcount, code.co_kwonlyargcount, code.co_flags & _VARIADIC)
    hashed.note(*arguments, *code.co_varnames, getattr(code, "co_exceptiontable", b""))
    constants: list[Any] = []
    chains: dict[str, list[list[str]]] = {"module": [], "closure": []}
    rebound, attributes, imports = set(), set(), []
    # The level of an import is the last value but one before it.
    before: deque[Any] = deque(maxlen=2)
    # The chain of names that the next attribute goes on with.
    chain: list[str] = []
    for op in dis.get_instructions(code):
        if op.opname == "EXTENDED_ARG":
            continue
        is_constant = op.opcode in dis.hasconst
        is_name = isinstance(op.argval, str) and not is_constant
        hashed.note(op.opname, op.argval if is_name else "" if is_constant else op.arg)
        if is_constant:
            constants.append(op.argval)
        if op.opname in ("LOAD_ATTR", "LOAD_METHOD"):
            chain.append(op.argval)
            continue
        chain = [op.argval] if is_name else []
        if op.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            chains["module"].append(chain)
        elif op.opname in ("LOAD_DEREF", "LOAD_CLASSDEREF"):
            chains["closure"].append(chain)
        elif op.opname == "STORE_GLOBAL":
            rebound.add(op.argval)
        elif op.opname == "STORE_ATTR":
            attributes.add(op.argval)
        elif op.opname == "IMPORT_NAME":
            imports.append("." * before[0] + op.argval)
        before.append(op.argval)
    of_module, of_closure = (
        tuple(dict.fromkeys(tuple(one) for one in found if one[0] not in rebound)) for found in chains.values()
    )
    return _Code(hashed.digest(), tuple(constants), of_module, of_closure, frozenset(attributes), tuple(imports))


class _Walk:
    """A hash over objects, and over those that they name."""

    def __init__(self, has_changing: bool) -> None:
        self._has_changing = has_changing
        self._hash = _Hash()
        # Functions, classes and objects by identity, in the order in which they are met.
        self._met: dict[int, tuple[int, Any]] = {}
        self._waiting: deque[Any] = deque()

    def digest(self) -> bytes:
        while self._waiting:
            self._visit(self._waiting.popleft())
        return self._hash.digest()

    def add(self, one: Any) -> None:
        """Hash a value; functions, classes and objects are visited later."""
        if isinstance(one, enum.Enum):
            self._hash.note("enum", type(one).__qualname__, one.name)
            self.add(one.value)
        elif isinstance(one, _PLAIN):
            self._hash.note(type(one).__name__, one if isinstance(one, bytes) else repr(one))
        elif isinstance(one, np.generic):
            self._hash.note("number", one.dtype.str, one.tobytes())
        elif isinstance(one, PurePath):
            self._hash.note("path", one)
        elif isinstance(one, (tuple, frozenset)):
            self._add_items(one)
        elif isinstance(one, _CONTAINERS):
            self._add_first_met(one, "", one)
        elif isinstance(one, (ModuleType, BuiltinFunctionType)):
            self._hash.note(type(one).__name__, one.__name__)
        elif str(type(one).__module__).partition(".")[0] == "maes":
            # Motions and wake-up conditions say what they are.
            self._hash.note(repr(one))
        else:
            if id(one) not in self._met:
                self._met[id(one)] = (len(self._met), one)
                self._waiting.append(one)
            self._hash.note("met", self._met[id(one)][0])

    def _apart(self, one: Any) -> bytes:
        walk = _Walk(self._has_changing)
        # What holds a set that holds it ends here.
        walk._met = dict(self._met)
        walk.add(one)
        return walk.digest()

    def _add_first_met(self, of: Any, name: str, value: Any) -> None:
        """Hash what a value was when it was first met, at this name of an object."""
        if not self._has_changing:
            return
        key = (id(of), name)
        if key not in _first_met:
            # What holds itself ends here.
            _first_met[key] = (of, b"in itself")
            walk = _Walk(True)
            if isinstance(value, _CONTAINERS):
                walk._add_items(value)
            else:
                walk.add(value)
            _first_met[key] = (of, walk.digest())
        self._hash.note("first", name, _first_met[key][1])

    def _add_items(self, one: Any) -> None:
        self._hash.note(type(one).__name__)
        if isinstance(one, np.ndarray):
            content = repr(one.tolist()) if one.dtype.hasobject else one.tobytes()
            self._hash.note(one.dtype.str, one.shape, content)
            return
        self._hash.note(len(one))
        if isinstance(one, dict):
            self._add_named(one)
        elif isinstance(one, (set, frozenset)):
            self._hash.note(*sorted(self._apart(item) for item in one))
        else:
            for item in one:
                self.add(item)

    def _add_named(self, values: Mapping[Any, Any]) -> None:
        for name, value in values.items():
            self.add(name)
            self.add(value)

    def _visit(self, one: Any) -> None:
        self._hash.note("visit", type(one).__name__)
        if isinstance(one, type):
            self._visit_class(one)
        elif isinstance(one, FunctionType):
            self._visit_function(one)
        elif isinstance(one, (staticmethod, classmethod)):
            self.add(one.__func__)
        elif isinstance(one, MethodType):
            self._add_items((one.__func__, one.__self__))
        elif isinstance(one, property):
            self._add_items((one.fget, one.fset, one.fdel))
        elif isinstance(one, functools.cached_property):
            self.add(one.func)
        elif isinstance(one, functools.partial):
            self._add_items((one.func, one.args))
            self._add_named(one.keywords)
        else:
            self.add(type(one))
            attributes = getattr(one, "__dict__", {})
            # What a decorator was put around: functools.wraps and lru_cache, Numba.
            self._add_items(tuple(attributes.get(name) for name in ("__wrapped__", "py_func")))
            if _is_own(type(one)):
                self.add(attributes)

    def _visit_class(self, one: type) -> None:
        self._hash.note(_is_own(one))
        if not _is_own(one):
            self._hash.note(one.__module__, one.__qualname__)
            return
        self._add_items(one.__bases__)
        values = vars(one)
        inherited = [value for base in one.__mro__ if _is_own(base) for value in vars(base).values()]
        functions = [value for value in inherited if isinstance(value, FunctionType)]
        changing = {name for function in functions for name in _read(function.__code__).attributes}
        for name in sorted(changing.union(values)):
            # A method may set what is not there at first.
            value = values.get(name)
            is_method = isinstance(value, _METHODS)
            if name in _OF_PYTHON or (_is_special(name) and not is_method):
                continue
            if name in changing and not is_method:
                self._add_first_met(one, name, value)
            else:
                self._hash.note(name)
                self.add(value)

    def _visit_function(self, one: FunctionType) -> None:
        self._hash.note(_is_own(one))
        if not _is_own(one):
            self._hash.note(one.__module__, one.__qualname__)
            return
        self.add(one.__defaults__)
        self._add_named(one.__kwdefaults__ or {})
        enclosed: dict[str, Any] = {}
        for name, cell in zip(one.__code__.co_freevars, one.__closure__ or ()):
            try:
                enclosed[name] = cell.cell_contents
            except ValueError:
                # It is not set yet.
                continue
        self._add_code(one.__code__, one.__globals__, enclosed)
        self._add_named(dict(sorted(vars(one).items())))

    def _add_code(self, code: CodeType, of_module: Mapping[str, Any], of_closure: Mapping[str, Any]) -> None:
        found = _read(code)
        self._hash.note(found.digest)
        for constant in found.constants:
            if isinstance(constant, CodeType):
                self._add_code(constant, of_module, of_closure)
            else:
                self.add(constant)
        for module in found.imports:
            self._hash.note(_source(module, of_module.get("__package__")))
        for names, chains in ((of_module, found.of_module), (of_closure, found.of_closure)):
            for first, *attributes in chains:
                # Of the module, its name and its file are no code.
                value = None if _is_special(first) and names is of_module else names.get(first)
                for attribute in attributes:
                    if not (isinstance(value, ModuleType) and _is_own(value)):
                        break
                    value = vars(value).get(attribute)
                if not (isinstance(value, ModuleType) and _is_own(value)):
                    self.add(value)


def _is_special(name: str) -> bool:
    return name.startswith("__") and name.endswith("__")


@functools.cache
def _standard() -> tuple[Path, ...]:
    return tuple({Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "platstdlib")})


@functools.lru_cache(4096)
def _is_own_module(name: str, file: str | None) -> bool:
    top = name.partition(".")[0]
    if top in ("__main__", "__mp_main__"):
        return True
    if top in ("maes", *sys.builtin_module_names):
        return False
    if file is None:
        return top not in sys.stdlib_module_names
    path = Path(file).resolve()
    return not (_INSTALLED.intersection(path.parts) or any(map(path.is_relative_to, _standard())))


def _source(module: str, package: str | None) -> bytes:
    """The file of a module of the user, which need not be imported yet; nothing for others."""
    try:
        spec = importlib.util.find_spec(module, package)
        if spec is None or spec.origin is None or not spec.has_location:
            return b""
        return Path(spec.origin).read_bytes() if _is_own_module(spec.name, spec.origin) else b""
    except (ImportError, ValueError, OSError):
        return b""


def _is_own(one: Any) -> bool:
    """Whether a module, class or function is of the user, and not of an installed package."""
    name = one.__name__ if isinstance(one, ModuleType) else one.__module__
    module = sys.modules.get(name) if isinstance(name, str) else None
    return isinstance(name, str) and _is_own_module(name, getattr(module, "__file__", None))
