"""Systems that a user's own Python code makes: ``FILE.py:NAME``, and entry points of installed packages.

These are the only references that execute code. Whatever the code does wrong is reported in one line that names the
file, the line and the exception.
"""

from __future__ import annotations

import inspect
import re
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from functools import lru_cache
from hashlib import sha256
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from quasilpv.errors import InputError, one_of
from quasilpv.systems.descriptor.open_parameters import OpenParameters
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.system_kind import Parameter, SystemKind

ENTRY_POINT_GROUP = "quasilpv.systems"
"""Entry points of this group name a system, or a function of parameters with defaults, in an installed package."""

_FILE_AND_NAME = re.compile(r"(?P<file>.+\.py):(?P<name>[^\W\d]\w*)")
_CACHED_SYSTEMS = 16  # of one function, by parameters; a system never changes


def is_python_reference(reference: str) -> bool:
    """Whether a reference is meant to name something in a Python file."""
    return reference.endswith(".py") or ".py:" in reference


def python_file_kind(reference: str) -> SystemKind:
    """The system, or the family of systems, that a name in a Python file stands for. Executes the file.

    Args:
        reference: ``FILE.py:NAME``; NAME is a `DescriptorSystem`, a function of parameters that all have defaults and
            that returns one, or a `SystemKind`. The parameters whose defaults are numbers are those of the kind.

    Returns:
        A kind whose id is the reference with an absolute path, so that any process of this machine resolves it again.

    Raises:
        InputError: another form, no such file or name, something else under that name, or the code fails.
    """
    match = _FILE_AND_NAME.fullmatch(reference)
    if match is None:
        raise InputError(
            "systems", "system", reference, "FILE.py:NAME, a system or a function of the file that makes one"
        )
    path = Path(match["file"]).expanduser().resolve()
    try:
        source = path.read_bytes()
    except OSError as error:
        raise InputError(str(path), "file", error.strerror or error, "a Python file") from None
    return _file_kind(path, match["name"], source)


@lru_cache(maxsize=8)
def _file_kind(path: Path, name: str, source: bytes) -> SystemKind:
    """Executed once for each content of the file."""
    module = _executed(path, source)
    if not hasattr(module, name):
        names = [n for n, value in vars(module).items() if _may_be_a_system(value, module)]
        raise InputError(
            str(path), "name", name, one_of(names, name, "the file") if names else "the name of a system of the file"
        )
    kind_id = f"{path}:{name}"
    return _kind(getattr(module, name), kind_id, f"{path.stem}-{name}", str(path), sha256(source).hexdigest())


def entry_point_kinds() -> dict[str, EntryPoint]:
    """The entry points of installed packages that name systems, by name; nothing of them is loaded."""
    return {point.name: point for point in entry_points(group=ENTRY_POINT_GROUP)}


@lru_cache(maxsize=8)
def entry_point_kind(point: EntryPoint) -> SystemKind:
    """The system that an installed package offers. Imports that package.

    Raises:
        InputError: it cannot be imported, or is no system and makes none.
    """
    source = f"entry point {point.name}"
    with _reported(source):
        loaded = point.load()
    fingerprint = f"{point.dist.name} {point.dist.version}" if point.dist else point.value
    return _kind(loaded, point.name, point.name, source, fingerprint)


def _may_be_a_system(value: Any, module: ModuleType) -> bool:
    own = inspect.isfunction(value) and value.__module__ == module.__name__
    return own or isinstance(value, DescriptorSystem | SystemKind)


def _executed(path: Path, source: bytes) -> ModuleType:
    """The module of a file, with the folder of the file first among those that are searched for imports."""
    module = ModuleType(path.stem)
    module.__file__ = str(path)
    sys.modules[f"quasilpv user file {path}"] = module  # dataclasses and pickling look a module up by name
    module.__name__ = f"quasilpv user file {path}"
    with _reported(str(path)), _beside(str(path)):
        exec(compile(source, str(path), "exec"), vars(module))
    return module


@contextmanager
def _beside(source: str) -> Iterator[None]:
    """Imports find what lies in the folder of the file, as if it were run; what it prints is no result of a verb."""
    folder = str(Path(source).parent)
    sys.path.insert(0, folder)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        if folder in sys.path:
            sys.path.remove(folder)


@contextmanager
def _reported(source: str) -> Iterator[None]:
    """Whatever a user's code raises, in one line with the last line of that file in the traceback."""
    try:
        yield
    except (Exception, SystemExit) as error:  # interrupts and stops are nobody's mistake
        where = _line(source, error)
        if isinstance(error, InputError):
            raise InputError(f"{source}{where}: {error.source}", error.field, error.got, error.expected) from None
        said = "".join(traceback.format_exception_only(type(error), error)[-1:]).strip()
        raise InputError(f"{source}{where}", "code", said, "code that runs") from None


def _line(source: str, error: BaseException) -> str:
    """Where in a file it happened; of code that is no file of its own, in which file too."""
    if isinstance(error, SyntaxError) and error.filename == source:
        return f":{error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if frame.filename == source]
    if own:
        return f":{own[-1].lineno}"
    return "" if source.endswith(".py") or not frames else f" ({frames[-1].filename}:{frames[-1].lineno})"


def _kind(value: Any, kind_id: str, stem: str, source: str, fingerprint: str) -> SystemKind:
    """A kind of what a name stands for."""
    if isinstance(value, SystemKind):
        parameters, build, summary = dict(value.parameters), value.build, value.summary
    elif isinstance(value, DescriptorSystem):
        parameters, summary = {}, f"{value.name}, {value.order} states"

        def build() -> DescriptorSystem:
            return value

    elif callable(value):
        parameters, build, summary = numeric_parameters(value, kind_id), value, _first_line(value)
    else:
        expected = "a DescriptorSystem, or a function of parameters with defaults that returns one"
        raise InputError(source, stem, f"the {type(value).__name__} {value!r:.40}", expected)
    # Nobody has proved what a user marks as affine; sweeps that rebuild give the same answers, more slowly.
    own = {name: Parameter(float(p.default), p.summary, p.unit) for name, p in parameters.items()}
    return SystemKind(
        id=kind_id,
        summary=summary,
        reference=kind_id,
        parameters=own,
        build=_guarded(build, parameters, source),
        stem=stem,
        fingerprint=fingerprint,
        left_open=_left_open(build, parameters, source),
    )


def numeric_parameters(function: Callable[..., Any], kind_id: str) -> dict[str, Parameter]:
    """The parameters of a function whose defaults are numbers.

    Raises:
        InputError: a parameter has no default.
    """
    found = {}
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            continue
        if parameter.default is parameter.empty or parameter.kind is parameter.POSITIONAL_ONLY:
            raise InputError(kind_id, f"parameter {name}", "no default that can be replaced by name", f"{name}=NUMBER")
        if isinstance(parameter.default, int | float):
            found[name] = Parameter(parameter.default, "")
    return found


def _first_line(function: Callable[..., Any]) -> str:
    described = inspect.getdoc(function) or ""
    return described.partition("\n")[0] or str(getattr(function, "__name__", "a function"))


def _guarded(
    build: Callable[..., Any], parameters: dict[str, Parameter], source: str
) -> Callable[..., DescriptorSystem]:
    """The function with numbers of the type of its defaults, its errors in one line, and what it made remembered."""

    @lru_cache(maxsize=_CACHED_SYSTEMS)
    def guarded(**values: float) -> DescriptorSystem:
        typed = {name: like_default(parameters[name].default, value) for name, value in values.items()}
        with _reported(source), _beside(source):
            made = build(**typed)
        if not isinstance(made, DescriptorSystem):
            name = getattr(build, "__name__", "build")
            raise InputError(source, f"{name}()", f"the {type(made).__name__} {made!r:.40}", "a DescriptorSystem")
        return made

    return guarded


def _left_open(
    build: Callable[..., Any], parameters: dict[str, Parameter], source: str
) -> Callable[[OpenParameters, Mapping[str, float]], DescriptorSystem]:
    """The function with open numbers for some parameters."""

    def make(record: OpenParameters, fixed: Mapping[str, float]) -> DescriptorSystem:
        typed = {name: like_default(parameters[name].default, value) for name, value in fixed.items()}
        with _beside(source):
            made: DescriptorSystem = build(**typed, **record.numbers())
        return made

    return make


def like_default(default: float, value: float) -> float:
    """A whole number stays one where the default is one: ``range(n)`` takes no float."""
    if isinstance(default, bool) and value in (0.0, 1.0):
        return bool(value)
    return int(value) if isinstance(default, int) and value.is_integer() else value
