"""Scene for tests of campaigns whose dataset is a store; the lines of a sweep follow."""

from __future__ import annotations

from support.campaign_scenes import swept_text

BODY = swept_text(title="a store", mass=0.001, damping_ratio=0.0, transient_periods=3)
