"""Each component's library keeps its size: a new feature may cost a tenth."""

from __future__ import annotations

import platform
import sys
import zipfile

import pytest

from vibroimpact.fmus import fmu_path

#: Bytes of each library before bodies gave derivatives, by gcc 12 on Linux, x86-64.
BYTES = {
    "AnalogInput": 80_104,
    "Beam": 393_688,
    "Chain": 389_328,
    "Exciter": 79_824,
    "Gain": 75_736,
    "ImpactStop": 84_528,
    "LoadCell": 88_904,
    "Noise": 79_984,
    "Oscillator": 362_512,
    "Replay": 101_104,
    "Sensor": 75_736,
    "Structure": 395_208,
}


@pytest.mark.skipif(
    not (sys.platform == "linux" and platform.machine() == "x86_64"), reason="sizes of Linux, x86-64"
)
@pytest.mark.parametrize("component", BYTES)
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_library_is_at_most_a_tenth_larger_than_it_was(component: str, version: str) -> None:
    with zipfile.ZipFile(fmu_path(component, version)) as archive:
        (library,) = (file for file in archive.infolist() if file.filename.endswith(".so"))
    assert library.file_size <= 1.1 * BYTES[component]
