"""The tables `[body]` of a scene file as frozen pydantic models, one module for each kind; `base` has the protocol."""

from vibroimpact.orchestrator.scene.body_models.beam import BeamBody, Rayleigh
from vibroimpact.orchestrator.scene.body_models.chain import ChainBody
from vibroimpact.orchestrator.scene.body_models.growing import PART_MODELS
from vibroimpact.orchestrator.scene.body_models.matrices import MatricesBody
from vibroimpact.orchestrator.scene.body_models.modes import ModesBody, Origin
from vibroimpact.orchestrator.scene.body_models.oscillator import OscillatorBody
from vibroimpact.orchestrator.scene.body_models.points import OneBody
from vibroimpact.orchestrator.scene.body_models.structure import BodyAlone, LinkTable, StructureBody

Body = OscillatorBody | ChainBody | BeamBody | ModesBody | StructureBody

BODY_MODELS: dict[str, type[OneBody]] = {
    "oscillator": OscillatorBody,
    "chain": ChainBody,
    "beam": BeamBody,
    "modes": ModesBody,
}
"""Models of one `[body]` by kind."""

__all__ = [
    "BODY_MODELS",
    "PART_MODELS",
    "BeamBody",
    "Body",
    "BodyAlone",
    "ChainBody",
    "LinkTable",
    "MatricesBody",
    "ModesBody",
    "OneBody",
    "Origin",
    "OscillatorBody",
    "Rayleigh",
    "StructureBody",
]
