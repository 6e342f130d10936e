"""Print what the package and some of its extras require, one a line: requirements.py EXTRA..."""

import re
import sys
from pathlib import Path

try:
    import tomllib
except ImportError:  # Python 3.10
    from pip._vendor import tomli as tomllib

PROJECT = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OWN = re.compile(re.escape(PROJECT["name"]) + r"\[(.*)\]")


def required(extras):
    """Requirements of extras, those of other extras that they name included."""
    for extra in extras:
        for line in PROJECT["optional-dependencies"][extra]:
            own = OWN.fullmatch(line)
            yield from required(own[1].split(",")) if own else [line]


print(*sorted({*PROJECT["dependencies"], *required(sys.argv[1:])}), sep="\n")
