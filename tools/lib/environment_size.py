"""Print what the packages of an environment take on its disk, and check it against the table of the installation guide.

Run by the Python of that environment. Arguments: the guide. Every package over 20 MB has to have a line there that says
what it is for, and all together take no more than the guide states.
"""

import re
import sys
from importlib.metadata import Distribution, distributions
from pathlib import Path

LEAST_MB = 20
MOST_MB = 650
LINE = re.compile(r"^\| `([A-Za-z0-9._-]+)` \| (\d+) \| (\S.*) \|$", re.MULTILINE)


def size_mb(distribution: Distribution) -> float:
    """Of all files of a package, with what Python has compiled of them."""
    paths = {Path(str(distribution.locate_file(file))).resolve() for file in distribution.files or ()}
    return sum(path.stat().st_size for path in paths if path.is_file()) / 1e6


def main() -> int:
    """Print the table; 1 if something is not as the guide says."""
    stated = {name: int(size) for name, size, _ in LINE.findall(Path(sys.argv[1]).read_text(encoding="utf-8"))}
    sizes = sorted(((size_mb(one), one.metadata["Name"]) for one in distributions()), reverse=True)
    total = sum(size for size, _ in sizes)
    for size, name in sizes:
        if size >= 1:
            print(f"{size:6.0f} MB  {name}")
    print(f"{total:6.0f} MB  all {len(sizes)}")
    wrong = [
        f"{name}: {size:.0f} MB, not in the guide" for size, name in sizes if size > LEAST_MB and name not in stated
    ]
    wrong += [f"all: {total:.0f} MB, expected at most {MOST_MB}"] if total > MOST_MB else []
    print(*wrong, sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
