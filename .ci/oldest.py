"""Print the oldest versions that pyproject.toml allows, as requirements of pip: of the package, and of extras named."""

import re
import sys
import tomllib
from pathlib import Path

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]

for line in sum((PROJECT["optional-dependencies"][extra] for extra in sys.argv[1:]), PROJECT["dependencies"]):
    if not line.startswith(PROJECT["name"]):
        name, least = re.fullmatch(r"([\w\[\]-]+)>=([\d.]+)", line).groups()
        print(f"{name}=={least}")
