"""The one writer: what it replaces and what never, whose files two commands at once write, and what a signal leaves."""

from __future__ import annotations

import ast
import json
import os
import re
import signal
import socket
import stat
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import quasilpv
from quasilpv.errors import InputError
from quasilpv.files import (
    MAX_FILE_BYTES,
    claim_file,
    claim_folder,
    forget_input,
    one_command,
    read_bytes,
    readable_json,
    write_atomically,
    write_readable_json,
    written_whole,
)

OLD, NEW = b"old content", b"new content"


def stream(path: Path, data: bytes) -> None:
    with written_whole(path) as file:
        file.write(data)


WRITERS = {"at once": lambda path, data: write_atomically({path: data}), "in parts": stream}
Write = Callable[[Path, bytes], None]


@pytest.fixture(params=WRITERS.values(), ids=WRITERS)
def write(request: pytest.FixtureRequest) -> Write:
    writer: Write = request.param
    return writer


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


PACKAGE = Path(quasilpv.__file__).parent
WRITING_CALLS = {"write_text", "write_bytes", "savefig", "NamedTemporaryFile", "mkstemp", "copy", "copyfile", "move"}
OWN_WAY = {
    "files": "the writer",
    "cli/streams.py": "opens the null device",
    "figures/style.py": "images are drawn into memory",
    "studies/checkpoint.py": "appends answers as they come",
}
"""Parts of the package that may call what writes, and why."""


def calls_that_write(source: str) -> list[str]:
    """Calls in a source that make, change or open a file for writing."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        modes = [argument.value for argument in node.args if isinstance(argument, ast.Constant)]
        modes += [keyword.value.value for keyword in node.keywords if isinstance(keyword.value, ast.Constant)]
        opens = name == "open" and any(re.fullmatch("[rbt]*[wax+][rbt+]*", str(mode)) for mode in modes)
        module = getattr(getattr(node.func, "value", None), "id", "")
        if opens or (name in WRITING_CALLS and (name not in {"copy", "move"} or module == "shutil")):
            found.append(f"{node.lineno}: {name}")
    return found


def test_nothing_in_the_package_writes_a_file_but_the_one_writer() -> None:
    assert calls_that_write("Path('x').write_text('')") == ["1: write_text"]
    assert calls_that_write("open('name', 'ab')") == calls_that_write("path.open(mode='r+b')") == ["1: open"]
    assert calls_that_write("open('name', 'rb')") == []
    others = {
        str(path.relative_to(PACKAGE)): calls
        for path in sorted(PACKAGE.rglob("*.py"))
        if (calls := calls_that_write(path.read_text(encoding="utf-8")))
    }
    strangers = {name: calls for name, calls in others.items() if not any(name.startswith(own) for own in OWN_WAY)}
    assert strangers == {}


# ---- what is replaced ------------------------------------------------------------------------------------------------


def make_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(path))


def make_device(path: Path) -> None:
    """The null device: a node of its own for root, who could replace it; else a link to that of the system."""
    if os.geteuid() == 0:
        os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, 3))
    else:
        path.symlink_to("/dev/null")


NOT_REPLACED = {
    "a device": make_device,
    "a named pipe": os.mkfifo,
    "a socket": make_socket,
    "a folder": Path.mkdir,
}


@pytest.mark.parametrize("linked", [False, True], ids=["itself", "through a link"])
@pytest.mark.parametrize("kind", NOT_REPLACED)
def test_when_the_target_is_no_regular_file_expect_a_line_and_it_left_as_it_is(
    kind: str, linked: bool, write: Write, tmp_path: Path
) -> None:
    try:
        NOT_REPLACED[kind](tmp_path / "it")
    except PermissionError:
        pytest.skip("nodes of devices cannot be made here")
    if linked:
        (tmp_path / "link").symlink_to("it")
    before = names(tmp_path), (tmp_path / "it").lstat()
    with pytest.raises(InputError, match=f"got {kind}, expected a regular file"):
        write(tmp_path / ("link" if linked else "it"), NEW)
    assert names(tmp_path) == before[0]
    assert (tmp_path / "it").lstat().st_ino == before[1].st_ino
    assert stat.S_IFMT((tmp_path / "it").lstat().st_mode) == stat.S_IFMT(before[1].st_mode)


def test_when_the_target_is_a_link_expect_the_file_it_names_replaced_and_the_link_kept(
    write: Write, tmp_path: Path
) -> None:
    (tmp_path / "elsewhere").mkdir()
    file, link, chain = tmp_path / "elsewhere" / "file", tmp_path / "link", tmp_path / "chain"
    file.write_bytes(OLD)
    link.symlink_to("elsewhere/file")
    chain.symlink_to("link")
    write(chain, NEW)
    assert chain.is_symlink()
    assert link.is_symlink()
    assert file.read_bytes() == NEW
    file.unlink()
    write(link, OLD)
    assert file.read_bytes() == OLD
    assert names(tmp_path / "elsewhere") == ["file"]


def test_when_links_go_round_in_a_circle_or_two_targets_are_one_file_expect_a_line(
    write: Write, tmp_path: Path
) -> None:
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(InputError, match="symbolic links"):
        write(tmp_path / "a", NEW)
    (tmp_path / "link").symlink_to("file")
    with pytest.raises(InputError, match="another name of a file written too"):
        write_atomically({tmp_path / "file": NEW, tmp_path / "link": OLD})
    assert names(tmp_path) == ["a", "b", "link"]


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o007, 0o000])
def test_a_new_file_has_the_mode_of_the_umask_and_a_replaced_one_that_of_the_old(
    mask: int, write: Write, tmp_path: Path
) -> None:
    before = os.umask(mask)
    try:
        write(tmp_path / "new", NEW)
        (tmp_path / "old").write_bytes(OLD)
        (tmp_path / "old").chmod(0o640)
        write(tmp_path / "old", NEW)
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o666 & ~mask
    assert stat.S_IMODE((tmp_path / "old").stat().st_mode) == 0o640


def test_when_root_replaces_a_file_of_another_user_expect_it_to_stay_theirs(write: Write, tmp_path: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root may give files away")
    (tmp_path / "theirs").write_bytes(OLD)
    os.chown(tmp_path / "theirs", 1234, 2345)
    write(tmp_path / "theirs", NEW)
    status = (tmp_path / "theirs").stat()
    assert (status.st_uid, status.st_gid) == (1234, 2345)


@pytest.mark.parametrize(
    "name", [b"\xff\xfe", b"line\nbreak", b"-o", b"'\"$(x)", b"\xc3\xa9", b"x" * 255, b"\xff" * 255], ids=repr
)
def test_any_name_that_the_file_system_allows_is_written_and_read(name: bytes, write: Write, tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(name)
    write(path, OLD)
    write(path, NEW)
    assert read_bytes(path) == NEW
    assert [os.fsencode(found) for found in names(tmp_path)] == [name]
    with pytest.raises(InputError, match="File name too long") as error:
        write(tmp_path / ("y" * 256), NEW)
    assert "\n" not in str(error.value)


def test_names_that_are_no_text_survive_in_json() -> None:
    tree = {"file": os.fsdecode(b"\xff.json"), "unit": "µm"}
    for encoding in ("utf-8", "ascii", "latin-1"):
        text = readable_json(tree, encoding)
        assert json.loads(text.encode(encoding).decode(encoding)) == tree
    assert "µ" in readable_json({"unit": "µm"})
    assert "µ" not in readable_json({"unit": "µm"}, "ascii")


def fail_after(data: bytes, path: Path, reason: Exception) -> None:
    with written_whole(path) as file:
        file.write(data)
        raise reason


def test_when_the_body_fails_expect_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(OLD)
    for reason, expected in ((ValueError("no"), ValueError), (OSError(28, "No space left"), InputError)):
        with pytest.raises(expected):
            fail_after(NEW, tmp_path / "file", reason)
    assert names(tmp_path) == ["file"]
    assert (tmp_path / "file").read_bytes() == OLD


# ---- inputs ----------------------------------------------------------------------------------------------------------

ALIASES: dict[str, Callable[[Path, Path], object]] = {
    "itself": lambda _file, _alias: None,
    "a link": lambda file, alias: alias.symlink_to(file),
    "a hard link": lambda file, alias: alias.hardlink_to(file),
    "a link to a hard link": lambda file, alias: (
        alias.with_name("hard").hardlink_to(file),
        alias.symlink_to("hard"),
    ),
}


@pytest.mark.parametrize("alias", ALIASES)
def test_when_the_target_is_an_input_of_the_command_expect_a_line_and_the_input_whole(
    alias: str, write: Write, tmp_path: Path
) -> None:
    file = tmp_path / "input"
    file.write_bytes(OLD)
    ALIASES[alias](file, tmp_path / "alias")
    target = file if alias == "itself" else tmp_path / "alias"
    with one_command("test"):
        assert read_bytes(file) == OLD
        with pytest.raises(InputError, match=rf"an input of this command \({file}\)"):
            write(target, NEW)
        write_atomically({target: OLD})  # what stays as it is may be named as an output
    assert file.read_bytes() == OLD
    with one_command("the next"):
        write(target, NEW)
    assert target.read_bytes() == NEW


def test_what_a_command_has_made_itself_it_may_make_again(write: Write, tmp_path: Path) -> None:
    with one_command("test"):
        for content in (OLD, NEW):
            write(tmp_path / "file", content)
            assert read_bytes(tmp_path / "file") == content
    with one_command("test"):
        assert read_bytes(tmp_path / "file") == NEW
        forget_input(tmp_path / "file")
        write(tmp_path / "file", OLD)
    assert (tmp_path / "file").read_bytes() == OLD


def test_a_device_that_never_ends_is_too_large() -> None:
    with pytest.raises(InputError, match=f"at most {MAX_FILE_BYTES} bytes"):
        read_bytes("/dev/zero")


# ---- claims ----------------------------------------------------------------------------------------------------------

HOLD = """
import sys
from pathlib import Path
from quasilpv.files import claim_file, claim_folder, one_command
with one_command("design track"):
    (claim_folder if sys.argv[1] == "folder" else claim_file)(Path(sys.argv[2]))
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path: Path) -> Iterator[Callable[[str, Path], subprocess.Popen[str]]]:
    """Starts another process that claims a folder or a file until its input ends."""
    started: list[subprocess.Popen[str]] = []

    def start(kind: str, path: Path) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-c", HOLD, kind, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        started.append(process)
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        return process

    yield start
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("kind", ["folder", "file"])
def test_when_another_command_writes_there_expect_it_named_and_after_its_end_none(
    kind: str, holder: Callable[[str, Path], subprocess.Popen[str]], tmp_path: Path
) -> None:
    claim = claim_folder if kind == "folder" else claim_file
    target = tmp_path / "new" / "place"
    for end in ("quietly", "killed"):
        other = holder(kind, target)
        with one_command("test"), pytest.raises(InputError, match=rf"process {other.pid}, design track"):
            claim(target)
        with one_command("test"):
            claim(target.with_name("beside"))
        if end == "killed":
            other.kill()
        other.communicate()
        with one_command("test"):
            claim(target)
        assert [path for path in tmp_path.rglob("*") if not path.is_dir()] == []


def test_a_claim_leaves_no_folder_that_it_made_unless_something_came_into_it(tmp_path: Path) -> None:
    with one_command("test"):
        claim_folder(tmp_path / "a" / "b" / "c")
        claim_folder(tmp_path / "d")
        write_readable_json(tmp_path / "d" / "kept.json", {})
        claim_file(tmp_path / "e" / "file")
        assert (tmp_path / "a" / "b" / "c").is_dir()
        claim_folder(tmp_path / "a" / ".." / "d")  # what is its own already
    assert names(tmp_path) == ["d"]
    assert names(tmp_path / "d") == ["kept.json"]
    (tmp_path / "file").touch()
    with one_command("test"), pytest.raises(InputError, match="a folder that can be written"):
        claim_folder(tmp_path / "file" / "below")


@given(st.lists(st.binary(min_size=1, max_size=4000), min_size=2, max_size=6))
def test_when_several_write_one_file_at_once_expect_what_one_of_them_wrote(
    tmp_path_factory: pytest.TempPathFactory, contents: list[bytes]
) -> None:
    folder = tmp_path_factory.mktemp("race")
    failures: list[BaseException] = []

    def attempt(data: bytes) -> None:
        try:
            for write in WRITERS.values():
                write(folder / "file", data)
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=attempt, args=[data]) for data in contents]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []
    assert (folder / "file").read_bytes() in contents
    assert names(folder) == ["file"]


# ---- signals ---------------------------------------------------------------------------------------------------------

WRITE_SLOWLY = """
import sys, time
from pathlib import Path
from quasilpv.cli import app
from quasilpv.files import written_whole

def endless(**_: object) -> None:
    with written_whole(Path(sys.argv[1])) as file:
        file.write(b"new")
        print("writing", flush=True)
        time.sleep(60)

app.app = endless
app.main()
"""


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGINT"])
def test_when_stopped_while_it_writes_expect_the_old_file_nothing_else_and_a_code_of_its_own(
    name: str, tmp_path: Path
) -> None:
    (tmp_path / "file").write_bytes(OLD)
    command = [sys.executable, "-c", WRITE_SLOWLY, tmp_path / "file"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "writing\n"
        assert len(names(tmp_path)) == 2
        process.send_signal(signal.Signals[name])
        _, errors = process.communicate(timeout=30)
    assert process.returncode == 128 + signal.Signals[name]
    assert errors.startswith("error: ")
    assert errors.count("\n") == 1
    assert names(tmp_path) == ["file"]
    assert (tmp_path / "file").read_bytes() == OLD
