"""Model descriptions of any tool: violations of FMI's rules are graded, and repaired where no number changes.

`amended` is pure: from bytes it makes bytes that FMPy reads, and findings. `schema` checks FMI's schema, `variables`
causality, variability, start values, units and names, and `structure` ModelStructure.
"""

from vibroimpact.fmus.packaging.model_description.amending import Amended, amended
from vibroimpact.fmus.packaging.model_description.findings import Finding, Grade
from vibroimpact.fmus.packaging.model_description.schema import build_problems

__all__ = ["Amended", "Finding", "Grade", "amended", "build_problems"]
