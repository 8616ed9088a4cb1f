"""The tables `[body]` of a scene file as frozen pydantic models, one module for each kind; `base` has the protocol."""

from vibroimpact.orchestrator.scene.body_models.beam import BeamBody, Rayleigh
from vibroimpact.orchestrator.scene.body_models.chain import ChainBody
from vibroimpact.orchestrator.scene.body_models.oscillator import OscillatorBody

Body = OscillatorBody | ChainBody | BeamBody

BODY_MODELS: dict[str, type[Body]] = {"oscillator": OscillatorBody, "chain": ChainBody, "beam": BeamBody}

__all__ = ["BODY_MODELS", "BeamBody", "Body", "ChainBody", "OscillatorBody", "Rayleigh"]
