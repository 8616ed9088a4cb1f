import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_each_layer_imports_only_those_below_it_and_each_heavy_dependency_has_one_door() -> None:
    command = [sys.executable, "-c", "from importlinter.cli import lint_imports_command as run; run()"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    assert " 0 broken" in result.stdout


def test_the_build_of_the_fmus_starts_without_a_single_installed_package() -> None:
    # -S: no site-packages; the build hook imports these modules before anything is installed
    code = (
        "import sys, types; namespace = types.ModuleType('vibroimpact'); "
        f"namespace.__path__ = [{str(ROOT)!r}]; sys.modules['vibroimpact'] = namespace; "
        "import vibroimpact.fmus.build, vibroimpact.fmus.compiler"
    )
    result = subprocess.run([sys.executable, "-S", "-E", "-c", code], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
