"""A plugin for the pytest that runs NI's tests: their server and their devices are the virtual rig.

NI's files stay unchanged. They look for NI's server and for simulated devices by product on the machine. The plugin
replaces both in their modules before the first test. NI's tests skip themselves if they need another device.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from vibroimpact.hardware.daqmx import DaqError, DAQmxErrors, System, constants, nidaqmx, open_channel

ADDRESS = "VIBROIMPACT_CONFORMANCE_RIG"
REPORT = "VIBROIMPACT_CONFORMANCE_REPORT"
"""Variables of the environment: port of the rig, file of outcomes (a JSON object in each line)."""
_STANDS_FOR = ("PCIe-6363",)
_NOT_MODELLED = DAQmxErrors.ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT


class _Rig:
    """Replaces the fixture's start of NI's server."""

    def __init__(self) -> None:
        self.server_port = int(os.environ[ADDRESS])

    def __enter__(self) -> _Rig:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def _rig_device(system: Any) -> Any:
    for device in system.devices:
        if device.product_category == constants.ProductCategory.X_SERIES_DAQ:
            return device
    raise AssertionError("the rig has no device")


def pytest_sessionstart() -> None:
    """Redirect NI's fixtures to the rig."""
    theirs: Any = sys.modules["tests.conftest"]
    by_product = theirs._device_by_product_type

    def device_by_product_type(product_type: str, device_type: Any, system: Any) -> Any:
        if product_type in _STANDS_FOR:
            return _rig_device(system)
        return by_product(product_type, device_type, system)

    channel = open_channel(f"localhost:{os.environ[ADDRESS]}")
    # modules read the version of the driver at import
    System.local = staticmethod(lambda: System.remote(nidaqmx.GrpcSessionOptions(channel, "")))
    theirs.GrpcServerProcess = _Rig
    theirs._device_by_product_type = device_by_product_type
    # a board whose outputs can be read back: the rig can, although it is simulated
    theirs._x_series_device = lambda device_type, system, *_, **__: _rig_device(system)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect the tests that need the driver."""
    library = [item for item in items if "library_init_kwargs" in item.name]
    config.hook.pytest_deselected(items=library)
    items[:] = [item for item in items if item not in library]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[Any]) -> Iterator[None]:
    """Record the outcome of a test, and whether the rig refused it for lack of a model."""
    report = yield
    if report.when != "call" and report.passed:
        return report
    error = call.excinfo.value if call.excinfo is not None else None
    refused = isinstance(error, DaqError) and error.error_code == _NOT_MODELLED.value
    outcome = "refused" if refused and report.failed else report.outcome
    said = str(error).splitlines()[0] if error is not None and str(error) else repr(error)
    entry = {"test": item.nodeid, "outcome": outcome, "said": said if error is not None else ""}
    with Path(os.environ[REPORT]).open("a", encoding="utf-8") as file:
        file.write(json.dumps(entry) + "\n")
    return report
