"""Code in the current folder is ignored: no process of a command imports it."""

import subprocess
import sys
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from scipy.io import savemat
from support.fmu_factory import bouncing_ball
from support.places import EXAMPLES

#: Early or late imports of a command's processes: the interpreter's own modules and other people's.
TRAPS = (
    *("queue", "pickle", "struct", "signal", "threading", "multiprocessing", "subprocess", "json", "ctypes"),
    *(
        "numpy",
        "scipy",
        "netCDF4",
        "xarray",
        "dask",
        "distributed",
        "matplotlib",
        "fmpy",
        "pythonfmu",
        "ziglang",
    ),
    *("sitecustomize", "usercustomize", "vibroimpact"),
)
LAW = EXAMPLES / "user_contact_law.py"
GUARDED = """
[component.ball]
fmu = "BouncingBall.fmi2.fmu"
[component.other]
fmu = "BouncingBall.fmi2.fmu"
[record]
recorded_time = 1.0
variables = ["ball.h"]
rate = 10.0
[execution]
macro_step = 0.1
guard = true
deadline = 60.0
[scene]
units = "SI"
"""


@pytest.fixture
def trapped(tmp_path: Path) -> Path:
    """Return a folder full of modules that leave a mark when imported."""
    for name in TRAPS:
        (tmp_path / f"{name}.py").write_text(
            f"open({str(tmp_path / 'imported')!r}, 'a').write({name + chr(10)!r})\n"
            "raise ImportError('imported from the current folder')\n"
        )
    return tmp_path


def checked(folder: Path, *arguments: str) -> str:
    """Run the installed command in a folder, as a user does; return its output."""
    command = Path(sys.executable).with_name("vibroimpact")
    done = subprocess.run([command, *arguments], cwd=folder, capture_output=True, text=True, timeout=120)
    marks = folder / "imported"
    assert not marks.exists(), marks.read_text()
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_no_process_of_a_guarded_run_a_campaign_or_a_plot_imports_the_current_folder(trapped: Path) -> None:
    bouncing_ball(trapped)
    (trapped / "ball.toml").write_text(GUARDED)
    (trapped / "sweep.toml").write_text(GUARDED + '[sweep]\n"ball.g" = { values = [9.0, 10.0] }\n')
    checked(trapped, "run", "ball.toml", "-o", "ball.nc")
    checked(trapped, "plot", "ball.nc", "-o", "ball.png")
    checked(trapped, "campaign", "sweep.toml", "-o", "sweep", "--workers", "1")


def test_no_process_of_an_import_or_a_check_imports_the_current_folder(trapped: Path) -> None:
    savemat(trapped / "data.mat", {"a": np.arange(9.0), "fs": 10.0})
    with netCDF4.Dataset(trapped / "data.nc", "w") as file:
        file.createDimension("time", 9)
        file.createVariable("time", "f8", ("time",))[:] = np.arange(9.0)
        file.createVariable("a", "f8", ("time",))[:] = np.arange(9.0)
    checked(trapped, "import", "data.mat", "-o", "a.nc")
    checked(trapped, "import", "data.nc", "-o", "b.nc")
    checked(trapped, "fmu", "check", str(bouncing_ball(trapped)))
    checked(trapped, "fmu", "export", "user-contact-law", "--law", str(LAW), "-o", "law.fmu")
