"""The programs of examples/exchange, which use derivatives in other tools: they reach what their pages say."""

from __future__ import annotations

import runpy

import pytest
from support.places import ROOT


@pytest.mark.parametrize(
    ("program", "prints"),
    [
        ("estimation", "largest error: "),
        ("optimal_control", "3 impacts in 3 periods\nlast impact at 0.80000"),
        ("implicit_master", "displacement 0.00297492"),
    ],
)
def test_a_program_reaches_its_result(program: str, prints: str, capfd: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("casadi")
    main = runpy.run_path(str(ROOT / "examples" / "exchange" / f"{program}.py"))["main"]
    assert main() == 0
    assert prints in capfd.readouterr().out
