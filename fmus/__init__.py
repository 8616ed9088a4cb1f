"""The physics: FMUs, and the functions that build, check, find and export them.

>>> from vibroimpact.fmus import components, fmu_path
>>> "Oscillator" in components()
True
>>> fmu_path("Oscillator", fmi="2.0").name
'Oscillator.fmu'
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from vibroimpact.fmus.packaging.export import export_fmu as export
    from vibroimpact.fmus.shipped import component_name, components, fmu_path

__all__ = ["component_name", "components", "export", "fmu_path"]


if not TYPE_CHECKING:  # a type checker that saw `__getattr__` would accept any name

    def __getattr__(name: str) -> object:
        # The installation builds the FMUs before the packages that an export needs are installed.
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        import importlib

        if name == "export":
            return importlib.import_module(f"{__name__}.packaging.export").export_fmu
        return getattr(importlib.import_module(f"{__name__}.shipped"), name)
