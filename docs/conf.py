"""Sphinx configuration: pages of docs/, Python API from docstrings, C++ API from headers, the command's own help."""

import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from sphinx.application import Sphinx

import quasilpv

DOCS = Path(__file__).parent
ROOT = DOCS.parent

sys.dont_write_bytecode = True  # of the extensions: nothing is written but into the folder that was asked for
sys.path.append(str(DOCS / "_extensions"))

project = "quasilpv"
author = "quasilpv developers"
project_copyright = author
version = release = quasilpv.__version__

extensions = [
    "myst_nb",  # pages and notebooks; a test executes these, the site shows what they printed
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "columns",
    "command_help",
    "header_table",
    "mathml",
]
exclude_patterns = ["_*"]
default_role = "code"

myst_heading_anchors = 3
myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]  # as GitHub shows it
html_math_renderer = "mathml"
nb_execution_mode = "off"

autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_numpy_docstring = False
napoleon_custom_sections = [("Attributes", "params_style")]  # one entry each for "E, A, B, C: ..."
add_module_names = False
toc_object_entries = False
python_maximum_signature_line_length = 100

html_theme = "furo"
html_title = "quasilpv"
html_copy_source = False
html_show_sphinx = False
html_static_path = ["_static"]
html_css_files = ["quasilpv.css"]


def run_doxygen(output: Path) -> None:
    """Write the C++ pages, which html_extra_path puts beside the others.

    Raises:
        RuntimeError: doxygen is not installed.
        subprocess.CalledProcessError: a header's comment is wrong; doxygen has said where.
    """
    doxygen = shutil.which("doxygen")
    if doxygen is None:
        raise RuntimeError("doxygen is not installed: apt-get install doxygen")
    settings = (DOCS / "_doxygen/Doxyfile").read_text(encoding="utf-8") + f'OUTPUT_DIRECTORY = "{output}"\n'
    subprocess.run([doxygen, "-"], cwd=ROOT, input=settings, text=True, check=True)


def is_noise(_app: object, _what: str, _name: str, member: object, _skip: bool, _options: object) -> bool | None:
    """Leave out what says nothing: the fields of named tuples, which the class describes."""
    return True if str(getattr(member, "__doc__", "")).startswith("Alias for field number") else None


def keep_colon(_app: object, what: str, _name: str, _member: object, _options: object, lines: list[str]) -> None:
    """Napoleon takes what stands before a colon in the first line of a property for its type; of a second line not."""
    if what == "property" and ": " in lines[0]:
        lines.insert(0, "")


def setup(app: Sphinx) -> None:
    """Connect the above."""
    folder = TemporaryDirectory(prefix="quasilpv-doxygen-")
    run_doxygen(Path(folder.name))
    app.config.html_extra_path = [folder.name]  # type: ignore[attr-defined]
    app.connect("build-finished", lambda _app, _error: folder.cleanup())
    app.connect("autodoc-skip-member", is_noise)
    app.connect("autodoc-process-docstring", keep_colon, priority=400)  # before napoleon


# Two rooms have a class Robot: the robot itself, and the member of an artifact that names it.
suppress_warnings = ["ref.python"]
