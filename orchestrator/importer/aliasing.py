"""Bodies that move faster than others sample them, by the rates that the bodies report."""

from __future__ import annotations

import math

from vibroimpact.orchestrator.importer.adaptive.coupling import is_coupling
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.pairs.ends import BodyRate

#: Phase of a motion between two samples, rad, above which the motion is aliased (Nyquist's limit).
LIMIT = math.pi * (1.0 + 1e-9)


class SampledRates:
    """The rates of the bodies of an importer that feed other components."""

    def __init__(self, importer: Importer) -> None:
        self._importer = importer
        transfers = [t for t in importer.transfers if any(map(is_coupling, t.connections))]
        self._rates = {t.source.name: BodyRate(t.source) for t in transfers if t.source is not t.target}

    def remarks(self) -> list[str]:
        """Return a remark for each body with less than two samples in its shortest reported period."""
        importer = self._importer
        step = importer.macro_step if importer.adaptive is None else importer.adaptive.record.largest
        found = {name: rate.fastest() for name, rate in self._rates.items() if math.isfinite(step)}
        return [
            f"{name} reports motion of {rate:.4g} rad/s, a period of {2.0 * math.pi / rate:.3g} s, but others sample "
            f"it every {step:.3g} s: motion this fast is aliased, which a shorter macro_step avoids"
            for name, rate in found.items()
            if step * rate > LIMIT
        ]
