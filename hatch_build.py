"""Build hook: compiles the FMUs into the wheel, and links the packages for an editable install."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import types
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PACKAGES = ("fmus", "orchestrator", "analysis", "hardware", "service")
DOOR = "door"
EXAMPLES = "service/examples"
"""Folder of the starting scenes in the page of the service."""
PACKAGE = "vibroimpact"
ZIG = "ziglang>=0.13"
RELEASE = "VIBROIMPACT_RELEASE"
"""Variable that makes a wheel carry the libraries of all platforms, once it is set: `make wheel`."""


class FmuBuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Adds binaries for this machine, which the sources do not have."""

    def dependencies(self) -> list[str]:
        """Return a compiler as a requirement if this machine has none, or for a release."""
        self._make_importable()
        from vibroimpact.fmus.packaging.compiler import has_compiler

        return [] if has_compiler() and RELEASE not in os.environ else [ZIG]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the FMUs: into the wheel, or into the checkout for an editable install."""
        self._make_importable()
        from vibroimpact.fmus.packaging.build import BUILT, build, build_platforms, is_current

        # strict only on the project's own machines: a newer compiler's new warning must not stop a user
        if version == "editable":
            link_packages(Path(self.root))
            build(BUILT, strict=False)
        else:
            self._built = Path(tempfile.mkdtemp())
            if is_current():
                shutil.copytree(BUILT, self._built, dirs_exist_ok=True)
            else:
                build(self._built, strict=False)
            if RELEASE in os.environ:
                build_platforms(self._built)
            build_data["force_include"][str(self._built)] = f"{PACKAGE}/fmus/built"
            build_data["force_include"][str(Path(self.root, "LICENSE"))] = f"{PACKAGE}/fmus/LICENSE"
            for path in Path(self.root, "examples").glob("*.toml"):
                build_data["force_include"][str(path)] = f"{PACKAGE}/{EXAMPLES}/{path.name}"
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{_platform()}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the files made for the wheel."""
        if version != "editable":
            shutil.rmtree(self._built)

    def _make_importable(self) -> None:
        # the folders of the checkout are not yet installed as parts of the package
        package = types.ModuleType(PACKAGE)
        package.__path__ = [self.root]
        sys.modules[PACKAGE] = package


def link_packages(root: Path) -> None:
    """Make `.editable/vibroimpact` the package: links to the door's modules and the packages' folders."""
    folder = root / ".editable" / PACKAGE
    folder.mkdir(parents=True, exist_ok=True)
    for package in PACKAGES:
        link = folder / package
        if not link.exists():
            _link(link, root / package)
    for module in (*(root / DOOR).glob("*.py"), root / DOOR / "py.typed"):
        _link_file(folder / module.name, module)


def _link_file(link: Path, target: Path) -> None:
    link.unlink(missing_ok=True)
    if sys.platform == "win32":
        link.hardlink_to(target)
    else:
        link.symlink_to(Path("../..", DOOR, target.name))


def _link(link: Path, target: Path) -> None:
    if sys.platform == "win32":
        # on Windows symbolic links need a privilege, junctions do not
        import _winapi

        _winapi.CreateJunction(str(target), str(link))
    else:
        link.unlink(missing_ok=True)
        link.symlink_to(Path("../..", target.name), target_is_directory=True)


def _platform() -> str:
    # the libraries are independent of Python: one wheel per platform serves every version of it
    from packaging.tags import sys_tags

    names = (tag.platform for tag in sys_tags())
    return next(name for name in names if "manylinux" not in name and "musllinux" not in name)
