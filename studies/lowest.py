"""The lowest versions that pyproject.toml allows, as constraints for pip.

    python -m studies.lowest > lowest.txt

One line NAME==VERSION per requirement with a lower bound, of the project and of all its extras. `make test-versions`
installs with it. Of packages that are not named in pyproject.toml, pip takes the newest that go with these.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

PYPROJECT = Path(__file__).resolve().parent.parent / "pyproject.toml"
REQUIREMENT = re.compile(r"(?P<name>[A-Za-z0-9_.-]+)\s*(?:>=|==)\s*(?P<version>[0-9][0-9a-z.]*)")


def lowest(pyproject: str) -> list[str]:
    """NAME==VERSION of every requirement with a lower bound, in the order of the file.

    Args:
      pyproject: text of a pyproject.toml.
    """
    project = tomllib.loads(pyproject)["project"]
    asked = [*project["dependencies"], *(one for extra in project["optional-dependencies"].values() for one in extra)]
    found = [match for one in asked if (match := REQUIREMENT.match(one))]
    return [f"{match['name']}=={match['version']}" for match in found]


if __name__ == "__main__":
    sys.stdout.write("\n".join(lowest(PYPROJECT.read_text())) + "\n")
