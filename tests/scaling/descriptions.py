"""Tokens of XML: descriptions of FMUs, structures (SSD), values (SSV) and mappings (SSM) of systems."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from support import ssp_files as ssp

from scaling._growth import Made, Tokens, each, run, texts
from vibroimpact.fmus.packaging import fmpy_door
from vibroimpact.fmus.safe_xml import root_of
from vibroimpact.orchestrator.ssp.archive import SspArchive
from vibroimpact.orchestrator.ssp.reading import read_structure
from vibroimpact.orchestrator.ssp.refusal import RefusalError
from vibroimpact.orchestrator.ssp.values import read_mapping, read_parameter_set

XML_HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
FMI3_VARIABLE = (
    '<Float64 name="v{at}" valueReference="{at}" causality="parameter" variability="fixed" start="1"/>'
)
FMI2_VARIABLE = (
    '<ScalarVariable name="v{at}" valueReference="{at}" causality="parameter" variability="fixed">'
    '<Real start="1"/></ScalarVariable>'
)
STRUCTURED = ' variableNamingConvention="structured"'


def fmi3(variables: str = "", *, more: str = "", structure: str = "", attributes: str = "") -> str:
    """Return a description of FMI 3.0."""
    return (
        f'{XML_HEAD}<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t"{attributes}>'
        f'<CoSimulation modelIdentifier="m"/>{more}<ModelVariables>{variables}'
        '<Float64 name="time" valueReference="4000000000" causality="independent" variability="continuous"/>'
        f"</ModelVariables><ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )


def fmi2(variables: str = "", *, more: str = "", structure: str = "") -> str:
    """Return a description of FMI 2.0."""
    return (
        f'{XML_HEAD}<fmiModelDescription fmiVersion="2.0" modelName="m" guid="t"><CoSimulation modelIdentifier="m"/>'
        f"{more}<ModelVariables>{variables}</ModelVariables><ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )


def _variables(line: str, wrap: Callable[..., str] = fmi3) -> Made:
    return lambda n: wrap(each(line)(n))


def _wrapped(line: str, before: str, after: str, wrap: Callable[..., str] = fmi3) -> Made:
    return lambda n: wrap("", more=each(line, before, after)(n))


OUTPUT3 = '<Float64 name="v{at}" valueReference="{at}" causality="output" variability="continuous"/>'
DESCRIPTION: Mapping[str, Made] = {
    "variables": _variables(FMI3_VARIABLE),
    "variables of FMI 2.0": _variables(FMI2_VARIABLE, fmi2),
    "variables without start": _variables(FMI3_VARIABLE.replace(' start="1"', "")),
    "variables of FMI 2.0 without start": _variables(FMI2_VARIABLE.replace(' start="1"', ""), fmi2),
    "variables of one name": _variables(FMI3_VARIABLE.replace("v{at}", "v")),
    "variables of one reference": _variables(FMI3_VARIABLE.replace('"{at}"', '"1"')),
    "variables of unknown units": _variables(FMI3_VARIABLE.replace("/>", ' unit="u{at}"/>')),
    "variables of unknown types": _variables(FMI3_VARIABLE.replace("/>", ' declaredType="u{at}"/>')),
    "variables of unknown causality": _variables(FMI3_VARIABLE.replace('"parameter"', '"word"')),
    "variables of unknown variability": _variables(FMI3_VARIABLE.replace('"fixed"', '"word"')),
    "variables with a wrong minimum": _variables(FMI3_VARIABLE.replace("/>", ' min="word"/>')),
    "variables with odd attributes": _variables(FMI3_VARIABLE.replace("/>", ' odd="1"/>')),
    "variables with odd attributes each": _variables(FMI3_VARIABLE.replace("/>", ' odd{at}="1"/>')),
    "odd elements": _variables("<Odd{at}/>"),
    "odd elements of one name": _variables("<Odd/>"),
    "constant inputs": _variables(
        FMI3_VARIABLE.replace('"parameter"', '"input"').replace('"fixed"', '"constant"')
    ),
    "continuous parameters": _variables(FMI3_VARIABLE.replace('"fixed"', '"continuous"')),
    "outputs": _variables(OUTPUT3),
    "outputs in the structure": lambda n: fmi3(
        each(OUTPUT3)(n), structure=each('<Output valueReference="{at}"/>')(n)
    ),
    "outputs of FMI 2.0 in the structure": lambda n: fmi2(
        each(
            '<ScalarVariable name="v{at}" valueReference="{at}" causality="output"><Real/></ScalarVariable>'
        )(n),
        structure=each('<Unknown index="{at}"/>', "<Outputs>", "</Outputs>")(n),
    ),
    "derivatives": lambda n: fmi3(
        each(
            '<Float64 name="v{at}" valueReference="{at}"/>'
            '<Float64 name="d{at}" valueReference="1{at}" derivative="{at}"/>'
        )(n),
        structure=each('<ContinuousStateDerivative valueReference="1{at}"/>')(n),
    ),
    "dependencies": lambda n: fmi3(
        each(OUTPUT3)(n),
        structure=f'<Output valueReference="0" dependencies="{" ".join(map(str, range(n)))}"/>',
    ),
    "unknowns of nothing": lambda n: fmi3(structure=each('<Output valueReference="{at}"/>')(n)),
    "initial unknowns": lambda n: fmi3(
        each(OUTPUT3)(n), structure=each('<InitialUnknown valueReference="{at}"/>')(n)
    ),
    "aliases": lambda n: fmi3(
        each('<Alias name="w{at}"/>', '<Float64 name="v" valueReference="1">', "</Float64>")(n)
    ),
    "dimensions": lambda n: fmi3(
        run('<Dimension start="1"/>', '<Float64 name="v" valueReference="1" start="1">', "</Float64>")(n)
    ),
    "start values": lambda n: fmi3(
        FMI3_VARIABLE.replace("{at}", "1").replace('start="1"/>', f'start="{"1 " * n}">')
        + f'<Dimension start="{n}"/></Float64>'
    ),
    "units": _wrapped(
        '<Unit name="u{at}"><BaseUnit m="1"/></Unit>', "<UnitDefinitions>", "</UnitDefinitions>"
    ),
    "display units": _wrapped(
        '<DisplayUnit name="d{at}"/>', '<UnitDefinitions><Unit name="u">', "</Unit></UnitDefinitions>"
    ),
    "types": _wrapped('<Float64Type name="t{at}"/>', "<TypeDefinitions>", "</TypeDefinitions>"),
    "variables of types": lambda n: fmi3(
        each(FMI3_VARIABLE.replace("/>", ' declaredType="t{at}"/>'))(n),
        more=each('<Float64Type name="t{at}"/>', "<TypeDefinitions>", "</TypeDefinitions>")(n),
    ),
    "variables of types of FMI 2.0": lambda n: fmi2(
        each(FMI2_VARIABLE.replace("<Real ", '<Real declaredType="t{at}" '))(n),
        more=each('<SimpleType name="t{at}"><Real/></SimpleType>', "<TypeDefinitions>", "</TypeDefinitions>")(
            n
        ),
    ),
    "variables of units": lambda n: fmi3(
        each(FMI3_VARIABLE.replace("/>", ' unit="u{at}"/>'))(n),
        more=each('<Unit name="u{at}"/>', "<UnitDefinitions>", "</UnitDefinitions>")(n),
    ),
    "items of an enumeration": _wrapped(
        '<Item name="i{at}" value="{at}"/>',
        '<TypeDefinitions><EnumerationType name="e">',
        "</EnumerationType></TypeDefinitions>",
    ),
    "log categories": _wrapped('<Category name="c{at}"/>', "<LogCategories>", "</LogCategories>"),
    "annotations": _wrapped(
        "<Tool{at}/>", '<Annotations><Annotation type="t">', "</Annotation></Annotations>"
    ),
    "comments": _wrapped("<!-- a -->", "", ""),
    "letters of a comment": lambda n: fmi3(more=f"<!--{'x' * n}-->"),
    "instructions": _wrapped("<?a b?>", "", ""),
    "letters of text": lambda n: fmi3("x" * n),
    "entities": lambda n: fmi3("&lt;" * n),
    "letters of a name": lambda n: fmi3(FMI3_VARIABLE.replace("v{at}", "v" * n).replace("{at}", "1")),
    "points of a name": lambda n: fmi3(
        FMI3_VARIABLE.replace("v{at}", "v." * n + "v").replace("{at}", "1"), attributes=STRUCTURED
    ),
    "brackets of a name": lambda n: fmi3(
        FMI3_VARIABLE.replace("v{at}", "v[1," + "1," * n).replace("{at}", "1"), attributes=STRUCTURED
    ),
    "quotes of a name": lambda n: fmi3(
        FMI3_VARIABLE.replace("v{at}", "'" + "a" * n).replace("{at}", "1"), attributes=STRUCTURED
    ),
    "attributes": lambda n: fmi3(attributes="".join(f' a{at}="1"' for at in range(n))),
    "letters of an attribute": lambda n: fmi3(attributes=f' description="{"x" * n}"'),
    "letters of an unknown attribute": lambda n: fmi3(attributes=f' {"x" * n}="1"'),
    "namespaces": lambda n: fmi3(attributes="".join(f' xmlns:a{at}="u{at}"' for at in range(n))),
    "depth": lambda n: fmi3(more="<a>" * n + "</a>" * n),
    "open elements": lambda n: fmi3(more="<a>" * n),
    "line breaks": lambda n: "\n" * n + fmi3(),
}

REAL = ssp.real(1.5)
COMPONENTS = (
    '<ssd:Component name="c{at}" source="a.fmu"><ssd:Connectors><ssd:Connector name="u" kind="input"/>'
    "</ssd:Connectors></ssd:Component>"
)
SSD: Mapping[str, Made] = {
    "components": lambda n: ssp.ssd(each(COMPONENTS)(n)),
    "components of one name": lambda n: ssp.ssd(COMPONENTS * n),
    "connections": lambda n: ssp.ssd(
        each(COMPONENTS)(n),
        each('<ssd:Connection startElement="c0" startConnector="u" endElement="c{at}" endConnector="u"/>')(n),
    ),
    "connectors": lambda n: ssp.ssd("", connectors=each(ssp.connector("x{at}", "input"))(n)),
    "parameters": lambda n: ssp.ssd("", bindings=ssp.values({f"p{at}": REAL for at in range(n)})),
    "bindings": lambda n: ssp.ssd("", bindings=ssp.values({"p": REAL}) * n),
    "entries": lambda n: ssp.ssd(
        "",
        bindings=ssp.values({"p": REAL}, mapping=ssp.mapping(*(ssp.entry("p", f"q{at}") for at in range(n)))),
    ),
    "units": lambda n: ssp.ssd("", units=each('<ssc:Unit name="u{at}"><ssc:BaseUnit m="1"/></ssc:Unit>')(n)),
    "systems in systems": lambda n: ssp.ssd(
        "".join('<ssd:System name="s"><ssd:Elements>' for _ in range(n)) + "</ssd:Elements></ssd:System>" * n
    ),
    "systems": lambda n: ssp.ssd(each('<ssd:System name="s{at}"/>')(n)),
    "annotations": lambda n: ssp.ssd(
        "",
        more="<ssd:Annotations>"
        + '<ssc:Annotation type="a"><b/></ssc:Annotation>' * n
        + "</ssd:Annotations>",
    ),
    "namespaces": lambda n: ssp.ssd("", more="".join(f'<a xmlns:n{at}="u{at}"/>' for at in range(n))),
    "letters of a source": lambda n: ssp.ssd(f'<ssd:Component name="c" source="{"x" * n}"/>'),
    "escapes of a source": lambda n: ssp.ssd(f'<ssd:Component name="c" source="{"%41" * n}"/>'),
    "folders of a source": lambda n: ssp.ssd(f'<ssd:Component name="c" source="{"a/" * n}"/>'),
    "digits of a time": lambda n: ssp.ssd("", times=f'stopTime="{"1" * n}"'),
}
PARAMETER = f'<ssv:Parameter name="p">{REAL}</ssv:Parameter>'
SSV: Mapping[str, Made] = {
    "parameters": lambda n: ssp.ssv({f"p{at}": REAL for at in range(n)}),
    "parameters of one name": lambda n: ssp.ssv({}).replace(
        "<ssv:Parameters>", "<ssv:Parameters>" + PARAMETER * n
    ),
    "values of a parameter": lambda n: ssp.ssv({"p": REAL * n}),
    "letters of a text": lambda n: ssp.ssv({"p": f'<ssv:String value="{"x" * n}"/>'}),
    "digits": lambda n: ssp.ssv({"p": f'<ssv:Real value="{"1" * n}"/>'}),
    "decimals": lambda n: ssp.ssv({"p": f'<ssv:Real value="0.{"1" * n}"/>'}),
    "digits of a whole number": lambda n: ssp.ssv({"p": f'<ssv:Integer value="{"1" * n}"/>'}),
    "blanks": lambda n: ssp.ssv({"p": f'<ssv:Real value="{" " * n}x"/>'}),
}
SPACES = (
    'xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping" '
    'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"'
)
SSM: Mapping[str, Made] = {
    "entries": lambda n: _ssm(each(ssp.entry("p{at}", "q{at}"))(n)),
    "entries of one source": lambda n: _ssm(each(ssp.entry("p", "q{at}"))(n)),
    "entries of one target": lambda n: _ssm(each(ssp.entry("p{at}", "q"))(n)),
    "transformations": lambda n: _ssm(ssp.entry("p", "q", ssp.factor(2.0) * n)),
}


def _ssm(entries: str) -> str:
    return f'<ssm:ParameterMapping {SPACES} version="1.0">{entries}</ssm:ParameterMapping>'


def _structure(path: Path) -> object:
    with (
        TemporaryDirectory() as folder,
        SspArchive(
            ssp.archive(Path(folder, "system.ssp"), path.read_text(encoding="utf-8"), {"a.fmu": b"x"})
        ) as archive,
        suppress(RefusalError),
    ):
        return read_structure(archive)


def _parameters(path: Path) -> object:
    with suppress(RefusalError):
        return read_parameter_set(root_of(path.read_bytes(), "tokens.ssv", namespaces=True), "tokens.ssv")


def _mapped(path: Path) -> object:
    with suppress(RefusalError):
        return read_mapping(root_of(path.read_bytes(), "tokens.ssm", namespaces=True), "tokens.ssm")


def all_tokens() -> list[Tokens]:
    """Return all kinds of tokens of XML."""
    return [
        *texts("FMU description", DESCRIPTION, lambda path: fmpy_door.read(path.read_bytes()), "tokens.xml"),
        *texts("SSD", SSD, _structure, "tokens.xml"),
        *texts("SSV", SSV, _parameters, "tokens.xml"),
        *texts("SSM", SSM, _mapped, "tokens.xml"),
    ]
