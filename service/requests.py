"""Bodies of requests, made from declared operations; a job carries the operation out."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, create_model

from vibroimpact.analysis.operations.estimate_decay import EstimateDecay
from vibroimpact.analysis.operations.estimate_impacts import EstimateImpacts
from vibroimpact.analysis.operations.estimate_response import EstimateResponse
from vibroimpact.analysis.operations.spikes import Spikes
from vibroimpact.fmus.operations import Operation, Request, declaring

OUTPUT = "estimates.nc"
"""Dataset of an estimate, in the folder of its job."""
ESTIMATES: dict[str, type[Operation]] = {
    "decay": EstimateDecay,
    "impacts": EstimateImpacts,
    "response": EstimateResponse,
    "spikes": Spikes,
}
"""Operations that a request can name, by its `kind`."""


def body_of(kind: str, declared: type[Operation]) -> type[BaseModel]:
    """Return the model of a request's body for an operation; unknown keys are refused."""
    fields: dict[str, Any] = {"kind": (Literal[kind], ...)}
    for key, field, request in _offered(declared):
        words = Field(description=field.words.help)
        fields[key] = (_annotated(_limited(field.type, request), words), field.default)
    summary = (inspect.getdoc(declared) or "").partition("\n")[0]
    return create_model(kind.capitalize(), __config__=ConfigDict(extra="forbid"), __doc__=summary, **fields)


def _offered(declared: type[Operation]) -> Iterator[tuple[str, declaring.Field, Request]]:
    for field in declared.fields():
        if (request := field.words.request) is not None:
            yield request.name or field.name, field, request


def _limited(kind: Any, request: Request) -> Any:
    """Return a type with the limits of an argument, inside unions and tuples too."""
    if get_args(kind):
        parts = tuple(_limited(each, request) for each in get_args(kind))
        return tuple[parts] if get_origin(kind) is tuple else Union[parts]  # type: ignore[valid-type]  # noqa: UP007
    if request.choices and kind is str:
        return Literal[request.choices]
    if kind is str:
        return _annotated(str, Field(min_length=1, max_length=200))
    if kind in (int, float):
        finite = False if kind is float else None
        limits = Field(gt=request.above, ge=request.least, le=request.most, allow_inf_nan=finite)
        return _annotated(kind, limits)
    return kind


def _annotated(kind: Any, words: Any) -> Any:
    annotated: Any = Annotated
    return annotated[kind, words]


if TYPE_CHECKING:
    Estimate = BaseModel
else:
    Estimate = Annotated[
        Union[tuple(body_of(kind, declared) for kind, declared in ESTIMATES.items())],  # noqa: UP007
        Field(discriminator="kind"),
    ]
_ESTIMATE: TypeAdapter[BaseModel] = TypeAdapter(Estimate)


def estimate(folder: Path, options: dict[str, Any]) -> None:
    """Carry out an estimate in the folder of a job.

    The options are `data`, the name of a recording or a dataset in the folder, and `asked`, an `Estimate`.
    """
    arguments = _ESTIMATE.validate_python(options["asked"]).model_dump()
    declared = ESTIMATES[arguments["kind"]]
    given = {field.name: arguments[key] for key, field, _ in _offered(declared)}
    place: dict[str, Any] = {"data": folder / options["data"], "output": folder / OUTPUT, "force": True}
    declared(**place, **given).carry_out(spelling=str)  # the arguments have Python's names
