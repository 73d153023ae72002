"""Print the pip requirements of a development environment, one a line, as pyproject.toml states them.

Arguments: extras beside ``dev``.
"""

import sys
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))
requirements = [
    *project["build-system"]["requires"],
    *project["project"]["dependencies"],
    *(line for extra in ("dev", *sys.argv[1:]) for line in project["project"]["optional-dependencies"][extra]),
]
print(*dict.fromkeys(requirements), sep="\n")
