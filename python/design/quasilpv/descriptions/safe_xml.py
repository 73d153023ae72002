"""XML of strangers: bounded in size and depth, without entities, and with included files only below one folder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from quasilpv.errors import InputError
from quasilpv.files import read_bytes

MOST_BYTES = 16 << 20
MOST_DEPTH = 200


def read_xml(path: Path) -> str:
    """The text of an XML file that declares no entities.

    Raises:
        InputError: the file cannot be read, is too large, is no XML, is nested too deeply, or has a document type.
    """
    content = read_bytes(path)
    if len(content) > MOST_BYTES:
        raise InputError(str(path), "size", f"{len(content)} bytes", f"at most {MOST_BYTES}")
    _check(path, content)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(str(path), "encoding", f"byte {error.start} of another", "UTF-8") from error


def _check(path: Path, content: bytes) -> None:
    """Refuse document types (only they can declare entities) and what is no XML."""
    depth = 0

    def refuse(*_: object) -> None:
        raise InputError(str(path), "DOCTYPE", "a document type", "plain XML: entities could name other files")

    def start(*_: object) -> None:
        nonlocal depth
        depth += 1
        if depth > MOST_DEPTH:
            raise InputError(str(path), "depth", f"more than {MOST_DEPTH} levels", "a description of a robot")

    def end(*_: object) -> None:
        nonlocal depth
        depth -= 1

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler, parser.EndElementHandler = start, end
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise InputError(str(path), f"line {error.lineno}", expat.ErrorString(error.code), "XML") from error


def root_of(path: Path, text: str) -> ElementTree.Element:
    """The root element of a text that `read_xml` has let through."""
    try:
        return ElementTree.fromstring(text)
    except ElementTree.ParseError as error:  # an encoding declared that is not the file's
        raise InputError(str(path), "file", error, "XML in UTF-8") from error


def included(path: Path, root: ElementTree.Element) -> Iterator[Path]:
    """The files that `<include file="...">` names.

    Raises:
        InputError: one lies outside of the folder of the including file.
    """
    folder = path.parent.resolve()
    for element in root.iter("include"):
        name = element.get("file", "")
        target = (folder / name).resolve()
        if not target.is_relative_to(folder):
            raise InputError(str(path), "include", name, f"a file below {folder}")
        yield target


def check_includes(path: Path, root: ElementTree.Element) -> None:
    """Refuse included files that are outside of the folder, missing, unsafe or include each other in a circle."""
    seen = {path.resolve()}
    waiting = [(path, root)]
    while waiting:
        where, element = waiting.pop()
        for target in included(where, element):
            if target in seen:
                raise InputError(str(where), "include", target.name, "each file once")
            seen.add(target)
            waiting.append((target, root_of(target, read_xml(target))))
