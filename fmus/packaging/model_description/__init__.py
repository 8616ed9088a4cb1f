"""Model descriptions of any tool: what breaks FMI's rules is graded, and mended where that changes no number.

`amended` is pure: bytes in, bytes that FMPy reads and findings out. `schema` looks at what FMI's schema says,
`variables` at causality, variability, start values, units and names, `structure` at ModelStructure.
"""

from vibroimpact.fmus.packaging.model_description.amending import Amended, amended
from vibroimpact.fmus.packaging.model_description.findings import Finding, Grade
from vibroimpact.fmus.packaging.model_description.schema import build_problems

__all__ = ["Amended", "Finding", "Grade", "amended", "build_problems"]
