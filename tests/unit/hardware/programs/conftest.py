"""A virtual rig in lockstep, unaffected by the load of the machine."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.places import ROOT

from vibroimpact.hardware import daqmx
from vibroimpact.hardware.rig.opening import Rig
from vibroimpact.hardware.virtual_rig.control import RigControl
from vibroimpact.hardware.virtual_rig.serving import served
from vibroimpact.hardware.virtual_rig.settings import read_rig


@pytest.fixture
def rig() -> Iterator[Rig]:
    settings = read_rig(ROOT / "examples" / "rig" / "oscillator.toml")
    with served(settings) as server, daqmx.open_channel(server.address) as channel:
        RigControl(channel).pace(lockstep=True)
        yield Rig(f"grpc://{server.address}", channel)


@pytest.fixture
def control(rig: Rig) -> RigControl:
    return RigControl(rig.channel)
