"""URDF from xacro: macros, includes and expressions evaluated, which is why only trusted files are.

Xacro evaluates Python expressions, reads any file that it is told to, and looks packages up; nothing here confines it.
What comes out is a URDF, which is read like any other.
"""

from __future__ import annotations

import contextlib
from pathlib import Path

from quasilpv.descriptions.library_output import captured_stderr
from quasilpv.errors import InputError
from quasilpv.files import read_bytes


def expanded(path: Path) -> bytes:
    """The URDF that a trusted xacro file evaluates to; packages are looked for in the folders above it.

    Raises:
        InputError: `xacrodoc` is not installed, the file cannot be read, or its evaluation fails.
    """
    try:
        import xacrodoc  # noqa: PLC0415 -- heavy, and an extra
    except ImportError as error:
        expected = "xacrodoc, which evaluates xacro: pip install 'quasilpv[robots]'"
        raise InputError(str(path), "library xacrodoc", "not installed", expected) from error
    read_bytes(path)
    # In its folder, from where it names others; what meshes are called does not matter.
    with captured_stderr() as said, contextlib.chdir(path.parent):
        try:
            text: str = xacrodoc.XacroDoc.from_file(path.name, resolve_packages=False).to_urdf_string()
        except Exception as error:  # whatever an expression raises
            reason = " ".join((said() or str(error) or type(error).__name__).split())
            raise InputError(str(path), "file", reason, "a xacro file that can be evaluated") from error
    return text.encode()
