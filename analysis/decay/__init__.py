"""Free decays and resonances: decrement, exponential fit, damping laws, frequency response, backbone.

Start at `estimate_decay` for a free decay, at `frequency_response` and `fit_resonance` for a driven one;
docs/damping.md describes the fitted models and the reasons for them.

Examples
--------
>>> import numpy as np
>>> from vibroimpact.analysis.recording import Channel, TimeAxis
>>> time = np.arange(0.0, 20.0, 0.05)
>>> motion = 3.0 + np.exp(-0.1 * time) * np.cos(5.0 * time)
>>> arm = Channel("arm", motion, "m", TimeAxis(time, 0.05), np.zeros(len(time), np.uint8))
>>> found = estimate_decay(decay_samples(arm), laws=())
>>> round(found.exponential.decay_rate.value, 6), round(found.exponential.offset.value, 6)
(0.1, 3.0)
"""

from vibroimpact.analysis.decay.decrement import logarithmic_decrement
from vibroimpact.analysis.decay.estimate import Estimate
from vibroimpact.analysis.decay.exponential import fit_exponential
from vibroimpact.analysis.decay.free_decay import FreeDecay, estimate_decay, print_decay
from vibroimpact.analysis.decay.frequency_response import FrequencyResponse, frequency_response
from vibroimpact.analysis.decay.law_fit import LawChoice, choose_law
from vibroimpact.analysis.decay.laws import ALL_LAWS, DampingLaw, damping_law
from vibroimpact.analysis.decay.resonance import Resonance, curve_of, fit_resonance
from vibroimpact.analysis.decay.samples import DecaySamples, decay_samples
from vibroimpact.analysis.decay.swept_response import swept_response

__all__ = [
    "ALL_LAWS",
    "DampingLaw",
    "DecaySamples",
    "Estimate",
    "FreeDecay",
    "FrequencyResponse",
    "LawChoice",
    "Resonance",
    "choose_law",
    "curve_of",
    "damping_law",
    "decay_samples",
    "estimate_decay",
    "fit_exponential",
    "fit_resonance",
    "frequency_response",
    "logarithmic_decrement",
    "print_decay",
    "swept_response",
]
