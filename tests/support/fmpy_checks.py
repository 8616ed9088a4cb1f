"""The findings of `fmpy validate` about an FMU, without its parser of names, which takes 10 ms for each name."""

import io
import re
import zipfile
from pathlib import Path

from fmpy.model_description import ValidationError, read_model_description
from fmpy.validation import validate_fmu

_PART = r"[A-Za-z_][A-Za-z_0-9]*(\[[0-9]+(,[0-9]+)*\])?"
_IDENTIFIER = rf"{_PART}(\.{_PART})*"
#: Names that both naming conventions of FMI allow: `contact[1].law`, `der(x)`. FMPy itself checks quoted names.
PLAIN_NAME = re.compile(rf"{_IDENTIFIER}|der\({_IDENTIFIER}\)")
_NAME = re.compile(r'<(?:ScalarVariable|Float64|Int64|Boolean|Enumeration)\s[^>]*?\bname="([^"]*)"')


def validate(path: Path) -> tuple[str, ...]:
    """Return the findings of `fmpy validate` about an FMU."""
    with zipfile.ZipFile(path) as archive:
        names = _NAME.findall(archive.read("modelDescription.xml").decode())
    if not all(PLAIN_NAME.fullmatch(name) for name in names):
        return tuple(validate_fmu(str(path)))
    return _problems(str(path))


def description_problems(content: bytes) -> tuple[str, ...]:
    """Return the findings of `fmpy validate` about a model description alone."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", content)
    return tuple(validate_fmu(file))


def _problems(file: str) -> tuple[str, ...]:
    try:
        read_model_description(file, validate_model_structure=True)
    except ValidationError as error:
        return tuple(error.problems)
    except Exception as error:
        return (str(error),)
    return ()
