"""The words of SSP: its namespaces, its types of files, and the annotations of this package and of others."""

from __future__ import annotations

SSD_FILE = "SystemStructure.ssd"
VERSIONS = ("1.0", "2.0")

_BASE = "http://ssp-standard.org/SSP1/SystemStructure"
#: Namespaces by the prefixes that other tools expect: some tools read the prefix instead of the namespace.
NAMESPACES = {
    "ssd": f"{_BASE}Description",
    "ssc": f"{_BASE}Common",
    "ssv": f"{_BASE}ParameterValues",
    "ssm": f"{_BASE}ParameterMapping",
    "ssb": f"{_BASE}SignalDictionary",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
    "vibroimpact": "urn:vibroimpact:ssp",
}
#: Type of this package's annotations.
ANNOTATION = "vibroimpact"
#: The annotation in which libcosim looks for its step.
OSP_ANNOTATION = "com.opensimulationplatform"
#: Annotation that OMSimulator's program requires, and in which it looks for its step.
OMS_ANNOTATION = "org.openmodelica"

FMU_TYPE = "application/x-fmu-sharedlibrary"
PACKAGE_TYPE = "application/x-ssp-package"
DEFINITION_TYPE = "application/x-ssp-definition"
"""Types of a component that is an archive, and of one that is another description in the same archive."""
DICTIONARY_TYPE = "application/x-ssp-signal-dictionary"
PARAMETER_SET_TYPE = "application/x-ssp-parameter-set"
MAPPING_TYPE = "application/x-ssp-parameter-mapping"

#: Kinds of connectors of an element that give a value, and kinds that take a value. For a system, seen from inside,
#: the roles are exchanged.
GIVING = frozenset({"output", "calculatedParameter", "local", "constant", "inout"})
TAKING = frozenset({"input", "parameter", "structuralParameter", "inout"})
#: Kind of an entry of a signal dictionary, which takes a value and gives it.
BOTH = "inout"

#: The component of this package that stands for the gain of a connection.
GAIN = "Gain"

REAL_TYPES = frozenset({"Real", "Float64", "Float32"})
INTEGER_TYPES = frozenset(
    {"Integer", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64"}
)


def tag(name: str) -> str:
    """Return the tag of an element as the parser writes it.

    >>> tag("ssd:System")
    '{http://ssp-standard.org/SSP1/SystemStructureDescription}System'
    """
    prefix, _, local = name.partition(":")
    return f"{{{NAMESPACES[prefix]}}}{local}"
