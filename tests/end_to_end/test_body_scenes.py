"""Chains, beams and compliant stops, from the scene file to the dataset and its figure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.campaign_scenes import assert_same_rows
from support.command_line import in_this_process

from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.dataset import Outcome
from vibroimpact.orchestrator.campaign import destination, run_campaign
from vibroimpact.orchestrator.campaign.manifest import scene_hash
from vibroimpact.orchestrator.campaign.parts import compact, list_parts
from vibroimpact.orchestrator.campaign.workers.chunks import Chunk, Work, run_chunk
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.run.dataset import DatasetForm
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import parse_scene

# issue 4: two unit masses, k = 1, c = 0.1, a stop on mass 2 at 0.1, the force on mass 1
CHAIN = """\
[scene]
title = "two masses"
[body]
kind = "chain"
masses = [1.0, 1.0]
stiffnesses = 1.0
dampings = 0.1
[forcing]
amplitude = [0.5, 0.0]
angular_frequency = 0.9
[[stop]]
position = 0.1
{law}
[record]
transient_periods = {transient}
recorded_periods = {recorded}
"""
BEAM = """\
[scene]
title = "a beam"
[body]
kind = "beam"
length = 0.25
width = 0.02
thickness = 0.002
youngs_modulus = 70e9
density = 2700
modes = 4
damping_ratio = [0.01, 0.01, 0.02, 0.02]
[forcing]
amplitude = 0.05
frequency = 25.0
[[stop]]
position = 0.0005
{law}
[record]
transient_periods = {transient}
recorded_periods = {recorded}
"""
SCENES = {"chain": CHAIN, "beam": BEAM}
RIGID = "restitution = 0.7"
YIELDING = 'law = "kelvin_voigt"\nstiffness = 2000.0\ndamping = 1.0'


def text_of(kind: str, law: str = RIGID, transient: int = 50, recorded: int = 4) -> str:
    return SCENES[kind].format(law=law, transient=transient, recorded=recorded)


def with_series(text: str, rate: float, names: list[str]) -> str:
    quoted = ", ".join(f'"{name}"' for name in names)
    return f"{text}time_series = {{ rate = {rate}, variables = [{quoted}] }}\n"


def test_the_period_one_orbit_of_the_chain_has_the_impacts_and_losses_of_the_issue(tmp_path: Path) -> None:
    text = with_series(
        text_of("chain", transient=400, recorded=5), 0.9 / (2 * np.pi), ["energy.contact_loss"]
    )
    run_scene(parse_scene(text, "chain.toml"), tmp_path / "run.nc")
    with open_dataset(tmp_path / "run.nc") as ds:
        assert ds.impact_velocity.values == pytest.approx([0.787660852554797] * 5, rel=1e-12)
        assert np.diff(ds.energy_contact_loss.values) == pytest.approx([0.158204452755] * 5, rel=1e-10)
        assert (ds.impact_restitution.values == 0.7).all()
        assert (ds.impact_duration.values == 0.0).all()


@pytest.mark.parametrize("kind", ["chain", "beam"])
def test_energy_is_what_the_forcing_did_less_what_damping_and_stops_took(kind: str, tmp_path: Path) -> None:
    names = [
        f"energy.{name}" for name in ("kinetic", "potential", "forcing_work", "damping_loss", "contact_loss")
    ]
    names += ["modal_energy[1]", "modal_energy[2]"] + (
        [f"modal_energy[{j}]" for j in (3, 4)] if kind == "beam" else []
    )
    rate = 20.0 if kind == "chain" else 2000.0
    run_scene(parse_scene(with_series(text_of(kind), rate, names), "s.toml"), tmp_path / "run.nc")
    with open_dataset(tmp_path / "run.nc") as ds:
        energy = (ds.energy_kinetic + ds.energy_potential).values
        balance = (ds.energy_forcing_work - ds.energy_damping_loss - ds.energy_contact_loss).values
        assert energy - energy[0] == pytest.approx(balance, abs=1e-10 * energy.max())
        modal = sum(ds[name].values for name in ds.variables if str(name).startswith("modal_energy_"))
        assert modal == pytest.approx(energy, rel=1e-12)
        assert ds.energy_contact_loss.values[-1] > 0.0


@pytest.mark.parametrize(
    ("kind", "names", "stored"),
    [
        (
            "chain",
            [
                "displacement",
                "displacement[2]",
                "velocity[1]",
                "acceleration[2]",
                "forcing[1]",
                "contact_force[1]",
            ],
            {"displacement": "m", "displacement_2": "m", "velocity_1": "m s-1", "acceleration_2": "m s-2"}
            | {"forcing_1": "N", "contact_force_1": "N"},
        ),
        (
            "beam",
            [
                "displacement",
                "contact_displacement[1]",
                "modal_displacement[3]",
                "modal_velocity[1]",
                "forcing",
            ],
            {"displacement": "m", "contact_displacement_1": "m", "modal_displacement_3": "m"}
            | {"modal_velocity_1": "m s-1", "forcing": "N"},
        ),
    ],
)
def test_sampled_elements_have_names_units_and_words_in_the_dataset(
    kind: str, names: list[str], stored: dict[str, str], tmp_path: Path
) -> None:
    text = with_series(text_of(kind, transient=5, recorded=2), 10.0, names)
    run_scene(parse_scene(text, "s.toml"), tmp_path / "run.nc")
    with open_dataset(tmp_path / "run.nc") as ds:
        sampled = {n: v.attrs["units"] for n, v in ds.variables.items() if v.dims == ("sample",)}
        assert {n: u for n, u in sampled.items() if n not in ("time", "sample_run")} == stored
        same = "displacement_2" if kind == "chain" else "contact_displacement_1"
        assert np.array_equal(ds.displacement.values, ds[same].values)  # the stop is at the observed point
        assert ds[same].attrs["long_name"] in ("displacement of mass 2", "displacement of the body at stop 1")


@pytest.mark.parametrize("law", [RIGID, YIELDING], ids=["rigid", "yielding"])
@pytest.mark.parametrize("kind", ["chain", "beam"])
def test_two_halves_of_a_run_are_the_run(kind: str, law: str) -> None:
    """The whole state is carried over: one run and two halves of it agree to 1e-12 of the state."""
    whole = PointRunner(parse_scene(text_of(kind, law, 0, 20), "s.toml")).run({})
    runner = PointRunner(parse_scene(text_of(kind, law, 0, 10), "s.toml"))
    first = runner.run({})
    assert first.final_state is not None
    second = runner.run({}, tuple(first.final_state.tolist()))
    assert whole.impacts is not None
    assert len(whole.impacts) > 10
    assert second.final_state == pytest.approx(whole.final_state, abs=1e-12 * np.abs(whole.final_state).max())


@pytest.mark.parametrize("law", [RIGID, YIELDING], ids=["rigid", "yielding"])
@pytest.mark.parametrize("kind", ["chain", "beam"])
def test_coupled_runs_are_fused_runs(kind: str, law: str) -> None:
    scene = parse_scene(text_of(kind, law, 0, 6), "s.toml")
    fused = PointRunner(scene, execution="fused").run({})
    coupled = PointRunner(scene, execution="coupled").run({})
    assert fused.impacts is not None
    # a contact that is open at the end of the run has no impulse and no duration
    assert coupled.impacts == pytest.approx(fused.impacts, rel=1e-9, abs=1e-12, nan_ok=True)
    assert coupled.final_state == pytest.approx(fused.final_state, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("kind", ["chain", "beam"])
def test_a_contact_with_a_stop_that_yields_is_one_impact_with_its_impulse_and_duration(
    kind: str, tmp_path: Path
) -> None:
    """The impulse is the integral of the contact force, here by the trapezoidal rule over samples."""
    names, rate = ["contact_force"], 2e3 if kind == "chain" else 2e5
    text = with_series(text_of(kind, YIELDING, 40, 1), rate, names)
    run_scene(parse_scene(text, "s.toml"), tmp_path / "run.nc")
    with open_dataset(tmp_path / "run.nc") as ds:
        is_over = np.isfinite(ds.impact_duration.values)
        assert is_over[:-1].all()
        # a contact may be open at both ends of the recording: from before its start, and beyond its end
        begins, last = ds.impact_time.values[0], np.append(ds.impact_time.values[~is_over], np.inf)[0]
        own = (ds.time.values >= begins) & (ds.time.values < last)
        impulse = np.trapezoid(ds.contact_force.values[own], ds.time.values[own])
        assert ds.impact_impulse.values[is_over].sum() == pytest.approx(impulse, rel=1e-3)
        assert (ds.impact_duration.values[is_over] > 0.0).all()
        assert (ds.impact_restitution.values[is_over] < 1.0).all()
        assert ds.contact_force.values.min() >= 0.0


def test_a_chain_pressed_on_a_stop_for_good_is_stuck_and_its_stick_stays_open(tmp_path: Path) -> None:
    text = """\
[body]
kind = "chain"
masses = [1.0, 1.0]
stiffnesses = 1.0
dampings = 0.5
[forcing]
amplitude = [0.0, 2.0]
angular_frequency = 0.0
[[stop]]
position = 0.1
restitution = 0.5
[record]
recorded_time = 60.0
"""
    run_scene(parse_scene(text, "s.toml"), tmp_path / "run.nc")
    with open_dataset(tmp_path / "run.nc") as ds:
        assert ds.outcome.values == Outcome.stuck
        assert np.isnan(ds.stick_end.values[-1])
        assert ds.final_displacement.values == pytest.approx(0.1, abs=1e-14)
    short = parse_scene(text.replace("recorded_time = 60.0", "recorded_time = 4.0"), "s.toml")
    record = PointRunner(short).run({})
    assert record.sticks is not None
    assert np.isnan(record.sticks[-1, 1])
    assert record.outcome is Outcome.ok  # the body rests, but not yet for a period of the slowest mode


SWEEP = '[sweep]\n"forcing.angular_frequency" = { start = 0.85, stop = 0.95, points = 6, path = "up-down" }\n'


def test_a_continuation_of_a_chain_is_the_same_however_it_is_cut_into_chunks(tmp_path: Path) -> None:
    text = text_of("chain", transient=20) + SWEEP
    scene = parse_scene(text, "s.toml")
    folder = tmp_path / "parts"
    folder.mkdir()
    work = Work(scene, str(folder), scene_hash=scene_hash(scene))
    carried = None
    for first, stop in ((0, 2), (2, 6)):
        carried = run_chunk(work, Chunk(0, first, stop, carried)).carried
    assert carried is not None
    assert len(carried) == 4
    stored = list_parts(folder, work.scene_hash, print)
    assert stored[-1].carried == carried
    carried = None
    for first, stop in ((6, 9), (9, 12)):
        carried = run_chunk(work, Chunk(1, first, stop, carried)).carried
    compact(
        [part.path for part in list_parts(folder, work.scene_hash, print)],
        tmp_path / "cut.nc",
        DatasetForm(scene),
        {},
    )
    run_scene(scene, tmp_path / "whole.nc")
    assert_same_rows(tmp_path / "cut.nc", tmp_path / "whole.nc")
    with open_dataset(tmp_path / "whole.nc") as ds:
        assert dict(ds.final_state.sizes) == {"direction": 2, "angular_frequency": 6, "state": 4}
        assert ds.final_state.values[..., 1] == pytest.approx(ds.final_displacement.values, abs=0.0)


def test_a_campaign_over_a_beam_that_was_broken_off_resumes_with_the_same_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cluster: str
) -> None:
    text = text_of("beam", transient=10, recorded=2)
    text += '[sweep]\n"body.length" = { start = 0.24, stop = 0.26, points = 8, path = "up" }\n'
    scene = parse_scene(text, "s.toml")

    class Stopped(Exception):
        pass

    def stop(*_: object) -> None:
        raise Stopped

    with monkeypatch.context() as patch:
        patch.setattr(destination, "compact", stop)
        with pytest.raises(Stopped):
            run_campaign(scene, tmp_path / "broken", scheduler=cluster)
    parts = sorted((tmp_path / "broken" / "parts").glob("*.nc"))
    kept = list_parts(tmp_path / "broken" / "parts", scene_hash(scene), print)
    assert kept[0].carried is None or len(kept[0].carried) == 8
    parts[-1].unlink()  # as if the process had been killed before it wrote this part
    report = run_campaign(scene, tmp_path / "broken", scheduler=cluster)
    assert report.runs == 8
    run_scene(scene, tmp_path / "whole.nc")
    assert_same_rows(report.dataset, tmp_path / "whole.nc")


@pytest.mark.parametrize("kind", ["chain", "beam"])
def test_a_scene_is_run_and_drawn_from_the_command_line(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names = ["displacement", "velocity", "modal_energy[1]", "modal_energy[2]"]
    Path("scene.toml").write_text(with_series(text_of(kind, recorded=1), 50.0, names))
    for arguments in (["run", "scene.toml", "-o", "run.nc"], ["plot", "run.nc", "-o", "run.png"]):
        done = in_this_process(*arguments)
        assert (done.returncode, done.stderr) == (0, "")
    assert Path("run.png").stat().st_size > 1000


def test_elements_of_a_chain_are_swept_into_named_coordinates(tmp_path: Path) -> None:
    text = text_of("chain", transient=5, recorded=1)
    text += (
        '[sweep]\n"body.masses[2]" = { values = [1.0, 2.0] }\n"stop[1].position" = { values = [0.1, 0.2] }\n'
    )
    run_scene(parse_scene(text, "s.toml"), tmp_path / "run.nc")
    with open_dataset(tmp_path / "run.nc") as ds:
        assert ds.masses_2.values.tolist() == [1.0, 2.0]
        assert ds.masses_2.attrs["units"] == "kg"
        assert (ds.outcome.values == Outcome.ok).all()
        alone = text_of("chain", transient=5, recorded=1).replace(
            "masses = [1.0, 1.0]", "masses = [1.0, 2.0]"
        )
        record = PointRunner(parse_scene(alone, "s.toml")).run({})
        found = ds.final_displacement.sel(masses_2=2.0, position=0.1).values
        assert found == pytest.approx(record.final_displacement, rel=1e-12)


@pytest.mark.parametrize(("body", "parameters"), [("Chain", '"masses" = 2'), ("Beam", '"modes" = 3')])
def test_chains_and_beams_are_components_of_general_scenes(
    body: str, parameters: str, tmp_path: Path
) -> None:
    start = '"velocity_start[1]" = 1.0' if body == "Chain" else '"modal_velocity_start[1]" = 0.01'
    text = f"""\
[component.body]
fmu = "{body}"
parameters = {{ {parameters}, {start} }}
[record]
recorded_time = 0.2
variables = ["body.displacement", "body.energy.kinetic"]
rate = 50
"""
    run_scene(parse_scene(text, str(tmp_path / "s.toml")), tmp_path / "run.nc")
    with open_dataset(tmp_path / "run.nc") as ds:
        assert np.abs(ds.body_displacement.values).max() > 0.0


def test_a_beam_too_thick_for_its_theory_says_so_on_the_command_line_and_in_the_dataset(
    tmp_path: Path,
) -> None:
    scene, output = tmp_path / "thick.toml", tmp_path / "thick.nc"
    scene.write_text(
        """
        [body]
        kind = "beam"
        length = 0.25
        width = 0.02
        thickness = 0.06
        youngs_modulus = 70e9
        density = 2700
        [record]
        recorded_time = 0.01
        """
    )
    arguments = ["run", str(scene), "-o", str(output)]
    done = in_this_process(*arguments)
    assert done.returncode == 0
    assert "warning: body: " in done.stderr
    with open_dataset(output) as dataset:
        assert "leaves the validity of Euler-Bernoulli's theory" in str(dataset.message.values)
