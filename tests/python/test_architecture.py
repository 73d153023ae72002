"""The order of the layers and the hygiene of the tree, read from the sources."""

import ast
import re
import subprocess
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "python" / "design" / "quasilpv"

# Every room of the package, lowest layer first. A room imports itself and the layers below its own.
LAYERS = (
    {"", "arrays", "defaults", "errors", "progress", "shown"},
    {"arguments", "extras", "files"},
    {"documents"},
    {"systems"},
    {"polytopes"},
    {"loops"},
    {"certificate"},
    {"lmi"},
    {"conditions"},
    {"studies"},
    {"synthesis"},
    {"artifact"},
    {"descriptions"},
    {"trajectories", "_runtime", "release", "system_release"},
    {"scenarios"},
    {"telemetry"},
    {"experiments"},
    {"figures"},
    {"chain", "system_chain"},
    {"exchange"},
    {"view"},
    {"reproduction"},
    {"cli"},
    {"__main__"},
)
RANK = {room: rank for rank, layer in enumerate(LAYERS) for room in layer}

# What a room must not load even through others, although the order would allow it.
SEPARATE = {
    "certificate": {"quasilpv.lmi", "quasilpv.conditions", "quasilpv.synthesis", "cvxpy", "clarabel"},
    "artifact": {"quasilpv.lmi", "quasilpv.conditions", "quasilpv.synthesis", "cvxpy", "clarabel"},
}


def module_name(path: Path) -> str:
    """Dotted name of a source file of the package."""
    parts = ("quasilpv", *path.relative_to(PACKAGE).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


SOURCES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}


def room_of(module: str) -> str:
    """Top-level room of a module of the package; "" is the package root."""
    return [*module.split("."), ""][1]


def imported_by(module: str, source: str, is_package: bool) -> Iterator[str]:
    """Absolute names of everything a module imports anywhere in its text; `from a import b` gives a and a.b."""
    package = module if is_package else module.rpartition(".")[0]
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*parents, *([node.module] if node.module else [])])
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)


IMPORTS = {
    name: set(imported_by(name, path.read_text(encoding="utf-8"), path.name == "__init__.py"))
    for name, path in SOURCES.items()
}


def imported_modules(source: str) -> Iterator[str]:
    """Modules that a text imports, for types too; `from a import b` gives a.b where that is a module, else a."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = (f"{node.module}.{alias.name}" for alias in node.names)
            yield from (name if name in SOURCES else node.module for name in names)


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Sets of two or more nodes that reach each other."""
    reach = {node: set(following) for node, following in graph.items()}
    while True:
        further = {node: own.union(*(reach[next_] for next_ in own)) for node, own in reach.items()}
        if further == reach:
            break
        reach = further
    found = {frozenset({node} | {other for other in reach[node] if node in reach[other]}) for node in graph}
    return [sorted(circle) for circle in found if len(circle) > 1]


NEIGHBOURS = {
    name: {
        other
        for other in imported_modules(path.read_text(encoding="utf-8"))
        if other in SOURCES and other != name and room_of(other) == room_of(name)
    }
    for name, path in SOURCES.items()
}
"""What every module imports of its own room."""


def loaded_with(module: str) -> set[str]:
    """Everything that importing a module imports, through modules of the package."""
    seen: set[str] = set()
    pending = [module]
    while pending:
        new = IMPORTS.get(pending.pop(), set()) - seen
        seen |= new
        pending += new
    return seen


def upward_imports(module: str, imports: set[str]) -> set[str]:
    """Imports of rooms of another name in the same or a higher layer."""
    own = room_of(module)
    # `from quasilpv import __version__` names no room.
    rooms = {name: room_of(name) for name in imports if name.startswith("quasilpv.") and room_of(name) in RANK}
    return {name for name, room in rooms.items() if room != own and RANK[room] >= RANK[own]}


# Rooms whose folders a reader takes in at a glance.
FEW_FILES = (
    PACKAGE / "artifact",
    PACKAGE / "certificate",
    PACKAGE / "conditions",
    PACKAGE / "documents",
    PACKAGE / "synthesis",
    PACKAGE / "systems",
)


@pytest.mark.parametrize("room", FEW_FILES, ids=lambda room: str(room.relative_to(ROOT)))
def test_no_folder_has_more_files_than_a_reader_takes_in_at_a_glance(room: Path) -> None:
    folders = [room, *(path for path in room.rglob("*") if path.is_dir() and path.name != "__pycache__")]
    counts = {folder: sum(path.is_file() for path in folder.iterdir()) for folder in folders}
    assert {str(folder): count for folder, count in counts.items() if count > 20} == {}


def test_every_room_has_a_place_in_the_order() -> None:
    assert SOURCES
    assert {room_of(module) for module in SOURCES} <= set(RANK)


@pytest.mark.parametrize("module", SOURCES)
def test_no_module_imports_a_higher_layer(module: str) -> None:
    assert upward_imports(module, IMPORTS[module]) == set()


def test_no_modules_of_a_room_import_each_other_in_a_circle() -> None:
    assert circles(NEIGHBOURS) == []


def test_no_folders_of_a_room_import_each_other_in_a_circle() -> None:
    folders = {
        name: ".".join(name.split(".")[:3])
        for name, path in SOURCES.items()
        if len(path.relative_to(PACKAGE).parts) > 2  # in a folder of the room
    }
    graph: dict[str, set[str]] = {folder: set() for folder in folders.values()}
    for name, folder in folders.items():
        graph[folder] |= {folders[other] for other in NEIGHBOURS[name] if other in folders} - {folder}
    assert circles(graph) == []


def test_when_two_modules_reach_each_other_expect_them_found() -> None:
    graph = {"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()}
    assert circles(graph) == [["b", "c"]]


@pytest.mark.parametrize("module", [name for name in SOURCES if room_of(name) in SEPARATE])
def test_separate_rooms_stay_independent_of_what_they_check(module: str) -> None:
    forbidden = SEPARATE[room_of(module)]
    loaded = loaded_with(module)
    assert {name for name in loaded if any(name == f or name.startswith(f + ".") for f in forbidden)} == set()


@pytest.mark.parametrize(
    "source",
    [
        "import quasilpv.cli",
        "from quasilpv import cli",
        "from quasilpv.cli import main",
        "from ..cli import main",
        "from .. import cli",
        "def late():\n    from quasilpv.cli import main",
    ],
)
def test_when_a_system_imports_the_command_line_in_any_spelling_expect_it_found(source: str) -> None:
    imports = set(imported_by("quasilpv.systems.arm", source, is_package=False))
    assert "quasilpv.cli" in upward_imports("quasilpv.systems.arm", imports)


def tracked_files(*patterns: str) -> list[Path]:
    """Files under version control, and new ones that are not ignored, that still exist."""
    command = ["git", "-c", f"safe.directory={ROOT}", "ls-files", "--cached", "--others", "--exclude-standard"]
    listing = subprocess.run([*command, "--", *patterns], cwd=ROOT, check=True, capture_output=True, text=True)
    return [path for line in sorted(set(listing.stdout.splitlines())) if (path := ROOT / line).is_file()]


def test_fixtures_shared_by_test_modules_have_names_of_their_own() -> None:
    # A plugin that one module loads serves every module of the process: of two fixtures of a name, one would be lost.
    names = Counter(
        node.name
        for path in tracked_files("tests/python/*.py")
        if not path.name.startswith("test_")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef) and any("fixture" in ast.unparse(mark) for mark in node.decorator_list)
    )
    assert names.keys() >= {"experiment", "logged_experiment"}
    assert [name for name, count in names.items() if count > 1] == []


def included_headers(path: Path) -> list[str]:
    """Header names of the include directives of a C++ file."""
    return re.findall(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', path.read_text(encoding="utf-8"), flags=re.MULTILINE)


def test_the_controller_never_includes_the_simulator() -> None:
    simulator = {str(header.relative_to(ROOT / "cpp/sim/include")) for header in tracked_files("cpp/sim/include/*.hpp")}
    simulator |= {header.name for header in tracked_files("cpp/sim/**.hpp")}
    files = tracked_files("cpp/controller/*.hpp", "cpp/controller/*.cpp")
    assert files
    assert [(file, name) for file in files for name in included_headers(file) if name in simulator] == []


CORE = ("include/core", "src/document", "src/artifact", "src/laws", "src/loop", "src/process")
"""Folders of quasilpv::core in cpp/controller."""


def test_the_core_of_the_controller_knows_no_transport() -> None:
    link = {header.name for header in tracked_files("cpp/controller/include/link/*.hpp", "lcmtypes/*.lcm")}
    link |= {f"{path.stem}.hpp" for path in tracked_files("lcmtypes/*.lcm")}
    files = tracked_files(*(f"cpp/controller/{folder}/*.[ch]pp" for folder in CORE))
    assert len(files) > 50
    assert len(link) > 10
    users = [
        (file, name)
        for file in files
        for name in included_headers(file)
        if name.startswith(("lcm/", "sodium")) or name.rpartition("/")[2] in link
    ]
    assert users == []


def test_no_public_header_includes_json() -> None:
    headers = tracked_files("cpp/*/include/*.hpp")
    assert len(headers) > 50
    users = [
        (file, name)
        for file in headers
        for name in included_headers(file)
        if "json" in name or name.startswith("document/")
    ]
    assert users == []


def test_no_folder_of_sources_has_more_than_twenty_files() -> None:
    files = tracked_files("cpp/*/src/*.[ch]pp")
    assert len(files) > 70
    count = Counter(file.parent for file in files)
    assert {folder: number for folder, number in count.items() if number > 20} == {}


def test_only_the_sources_of_the_ida_integrator_include_sundials() -> None:
    prefixes = ("ida/", "idas/", "nvector/", "sunmatrix/", "sunlinsol/", "sunnonlinsol/", "sundials/")
    users = {
        file.name
        for file in tracked_files("*.hpp", "*.cpp")
        for name in included_headers(file)
        if name.startswith(prefixes)
    }
    allowed = {
        "ida_integrator.cpp",
        "ida_kernels.cpp",
        "ida_kernels.hpp",
        "sundials_compat.hpp",
        "ida_kernels_test.cpp",
    }
    assert users == allowed


def test_no_build_file_relaxes_floating_point() -> None:
    flags = re.compile(r"-ffast-math|-Ofast|-funsafe-math|-ffinite-math|-fassociative-math")
    files = tracked_files("*CMakeLists.txt", "*.cmake", "CMakePresets.json", "pyproject.toml", "tools/lib/*")
    assert files
    # Comments may name the flags to say why they are not used.
    settings = {file: re.sub(r"#.*", "", file.read_text(encoding="utf-8")) for file in files}
    assert [file for file, text in settings.items() if flags.search(text)] == []


@pytest.mark.parametrize(
    ("what", "pattern"),
    [
        # Written so that they do not match themselves.
        ("path of a machine", r"(?<![\w.])/(?:work|root|home/\w+|Users/\w+)/"),
        ("unfinished place", r"\b(?:TO[D]O|FIX[M]E|NotImplemented[E]rror)\b"),
        ("unresolved merge", r"^(?:<{7}|>{7}) "),
    ],
)
def test_no_file_holds_what_does_not_belong_in_the_project(what: str, pattern: str) -> None:
    expression = re.compile(pattern, flags=re.MULTILINE)
    texts = {}
    for file in tracked_files():
        content = file.read_bytes()
        if b"\0" not in content:
            texts[file] = content.decode("utf-8")
    assert texts
    assert [f"{file.relative_to(ROOT)}: {what}" for file, text in texts.items() if expression.search(text)] == []
