"""`make audit`: known vulnerabilities in the installed versions, and in the lowest versions of pyproject.toml.

pip-audit asks the database of advisories. If the database cannot be reached, one line says so, and the audit passes.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[2]
UNREACHABLE = ("ConnectionError", "Could not connect", "Max retries exceeded", "ServiceError", "HTTPError")
"""Message of pip-audit without an answer from the database."""
REMARK = "make audit: the database of advisories could not be reached. Nothing is known of {}."


def lowest() -> Iterator[str]:
    """Yield each package of pyproject.toml that this machine would install, at its lowest version."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lists = [project["dependencies"], *project["optional-dependencies"].values()]
    found: dict[str, str] = {}
    for requirement in map(Requirement, (line for each in lists for line in each)):
        applies = requirement.marker is None or requirement.marker.evaluate()
        if requirement.name != project["name"] and applies:
            (bound,) = (one.version for one in requirement.specifier if one.operator in (">=", "=="))
            found[requirement.name] = f"{requirement.name}=={bound}"
    yield from sorted(found.values(), key=str.lower)


def audited(what: str, *options: str) -> int:
    """Ask about some packages; return 1 if one has a known vulnerability, or if pip-audit itself fails."""
    command = [sys.executable, "-m", "pip_audit", "--progress-spinner", "off", "--format", "json", *options]
    done = subprocess.run(command, capture_output=True, text=True)
    try:
        answers = json.loads(done.stdout)["dependencies"]
    except (ValueError, KeyError):
        if any(word in done.stderr for word in UNREACHABLE):
            answers = []
        else:
            print(f"{what}: {done.stderr.strip()}", file=sys.stderr)
            return 1
    answered = [one for one in answers if "vulns" in one]
    holes = [one for one in answered if one["vulns"]]
    for one in holes:
        print(f"{what}: {one['name']} {one['version']}: {', '.join(hole['id'] for hole in one['vulns'])}")
    if answered:
        print(f"{what}: {len(answered)} of {len(answers)} packages are known, {len(holes)} with a hole.")
    else:
        # a package mirror has no advisories, and pip-audit reports its silence as "no known vulnerabilities"
        print(REMARK.format(what), file=sys.stderr)
    return int(bool(holes))


def main() -> int:
    """Ask about both sets of versions."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "lowest.txt")
        file.write_text("".join(f"{line}\n" for line in lowest()), encoding="utf-8")
        pinned = ("--requirement", str(file), "--no-deps", "--disable-pip")
        installed = audited("the installed versions", "--skip-editable")
        return max(installed, audited("the lowest versions", *pinned))


if __name__ == "__main__":
    sys.exit(main())
