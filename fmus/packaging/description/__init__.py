"""One `variables.toml` per component generates everything that lists its variables.

Both modelDescription.xml files, the C header with the value references, and the table in the component's
README come from the same file. The folder imports the standard library only: the package's own build uses it.
"""

from vibroimpact.fmus.packaging.description.c_header import c_header, header_name
from vibroimpact.fmus.packaging.description.lean import (
    Edition,
    Experiment,
    lean,
    with_starts,
    with_strobes,
    with_structural,
    with_units,
)
from vibroimpact.fmus.packaging.description.model import (
    ComponentDescription,
    Enumeration,
    EnumerationItem,
    Number,
    UnitDefinition,
    Variable,
    plural,
)
from vibroimpact.fmus.packaging.description.model_xml import literal, model_description, unit_definitions
from vibroimpact.fmus.packaging.description.reading import read_component
from vibroimpact.fmus.packaging.description.readme_table import readme_table, with_table
from vibroimpact.fmus.packaging.description.terminals import MEMBER as TERMINALS_MEMBER
from vibroimpact.fmus.packaging.description.terminals import terminals

__all__ = [
    "TERMINALS_MEMBER",
    "ComponentDescription",
    "Edition",
    "Enumeration",
    "EnumerationItem",
    "Experiment",
    "Number",
    "UnitDefinition",
    "Variable",
    "c_header",
    "header_name",
    "lean",
    "literal",
    "model_description",
    "plural",
    "read_component",
    "readme_table",
    "terminals",
    "unit_definitions",
    "with_starts",
    "with_strobes",
    "with_structural",
    "with_table",
    "with_units",
]
