"""Print the pip requirements of a development environment, one a line, as pyproject.toml states them.

Arguments: extras beside ``dev``. An extra that names others of this project, ``quasilpv[view,hil]``, has theirs.
"""

import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

metadata = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))
project = metadata["project"]


def of_extra(extra: str) -> Iterator[str]:
    """Requirements of an extra."""
    for line in project["optional-dependencies"][extra]:
        own = re.fullmatch(rf"{project['name']}\[(.+)\]", line)
        if own is None:
            yield line
        else:
            for name in own[1].split(","):
                yield from of_extra(name)


extras = (line for extra in ("dev", *sys.argv[1:]) for line in of_extra(extra))
print(*dict.fromkeys([*metadata["build-system"]["requires"], *project["dependencies"], *extras]), sep="\n")
