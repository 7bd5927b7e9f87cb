"""`calibctl vtk`: what ParaView's own library reads of a sample agrees with the sample's states."""

from __future__ import annotations

import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader

import calib
from conftest import PROGRAMS, calibctl, impacts, place, small_campaign

SAMPLE = 3
GRAINS = 64


def read(file: Path) -> Any:
    """The data set of a file as VTK reads it."""
    reader = vtkXMLUnstructuredGridReader() if file.suffix == ".vtu" else vtkXMLPolyDataReader()
    reader.SetFileName(str(file))
    reader.Update()
    assert reader.GetErrorCode() == 0, file
    return reader.GetOutput()


def arrays(of: Any) -> dict[str, Any]:
    return {of.GetArrayName(i): vtk_to_numpy(of.GetArray(i)) for i in range(of.GetNumberOfArrays())}


def series(file: Path) -> list[tuple[float, Path]]:
    """Times and files of a PVD."""
    sets = ElementTree.parse(file).getroot().iter("DataSet")
    return [(float(one.attrib["timestep"]), file.parent / one.attrib["file"]) for one in sets]


@pytest.fixture(scope="module")
def drawn(finished: tuple[calib.Client, str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    client, campaign = finished
    folder = tmp_path_factory.mktemp("drawn")
    answer = calibctl("vtk", campaign, str(SAMPLE), "-o", folder, *place(client))
    assert answer["written"] == [{"experiment": "tx", "folder": str(folder / "tx"), "load_steps": [0, 1, 2]}]
    return folder / "tx"


def test_series_name_a_file_per_load_step(drawn: Path) -> None:
    for name, suffix in (("grains", "vtu"), ("contacts", "vtp"), ("cell", "vtp")):
        assert series(drawn / f"{name}.pvd") == [(step, drawn / f"{name}_000{step}.{suffix}") for step in range(3)]


@pytest.mark.parametrize("step", range(3))
def test_grains_contacts_and_cell_agree_with_the_states(drawn: Path, finished: tuple[calib.Client, str], step: int) -> None:
    client, campaign = finished
    state = client.states(campaign, SAMPLE).loc[("tx", SAMPLE, step)]
    grains = read(drawn / f"grains_000{step}.vtu")
    contacts = read(drawn / f"contacts_000{step}.vtp")
    cell = read(drawn / f"cell_000{step}.vtp")

    at = vtk_to_numpy(grains.GetPoints().GetData())
    of_grains = arrays(grains.GetPointData())
    low, high = np.array(cell.GetBounds()).reshape(3, 2).T
    volume = np.prod(high - low)
    assert grains.GetNumberOfCells() == len(at) == GRAINS
    assert cell.GetNumberOfLines() == 12 and (low == 0).all()
    assert (at >= low).all() and (at <= high).all()
    solid = (4 / 3 * np.pi * of_grains["radius"] ** 3).sum()
    assert 1 - solid / volume == pytest.approx(state["porosity"], rel=1e-12)
    assert of_grains["velocity"].shape == (GRAINS, 3)

    ends = vtk_to_numpy(contacts.GetPoints().GetData()).reshape(-1, 2, 3)
    branch = ends[:, 1] - ends[:, 0]
    of_contacts = arrays(contacts.GetCellData())
    force = of_contacts["force"]
    assert contacts.GetNumberOfLines() == len(force)
    assert of_grains["coordination_number"].sum() == 2 * len(force)
    assert of_grains["coordination_number"].mean() == pytest.approx(state["coordination_number"], rel=1e-12)
    normal = np.einsum("ci,ci->c", force, branch / np.linalg.norm(branch, axis=1, keepdims=True))
    np.testing.assert_allclose(of_contacts["normal_force"], normal, rtol=1e-9, atol=1e-9 * np.abs(force).max())
    np.testing.assert_allclose(np.hypot(normal, of_contacts["tangential_force"]), np.linalg.norm(force, axis=1), rtol=1e-9)

    stress = np.einsum("ci,cj->ij", force, branch) / volume  # Love-Weber, compression positive
    assert stress[2, 2] == pytest.approx(state["axial_stress"], rel=1e-9)
    assert (stress[0, 0] + stress[1, 1]) / 2 == pytest.approx(state["lateral_stress"], rel=1e-9)
    np.testing.assert_allclose(arrays(cell.GetFieldData())["stress"][0], np.diag(stress), rtol=1e-9)


def test_one_load_step_alone_is_the_same_file(drawn: Path, finished: tuple[calib.Client, str], tmp_path: Path) -> None:
    client, campaign = finished
    answer = calibctl("vtk", campaign, str(SAMPLE), "--load-step", "1", "-o", tmp_path, *place(client))
    assert answer["written"][0]["load_steps"] == [1]
    files = sorted(path.name for path in (tmp_path / "tx").iterdir())
    assert files == ["cell.pvd", "cell_0001.vtp", "contacts.pvd", "contacts_0001.vtp", "grains.pvd", "grains_0001.vtu"]
    for name in ("cell_0001.vtp", "contacts_0001.vtp", "grains_0001.vtu"):
        assert (tmp_path / "tx" / name).read_bytes() == (drawn / name).read_bytes(), name


def refused(client: calib.Client, *arguments: str | Path) -> tuple[int, str]:
    """Exit code and sentence."""
    answer = subprocess.run([PROGRAMS / "calibctl", "vtk", *arguments, *place(client)], capture_output=True, text=True)
    assert answer.stdout == "" and answer.stderr.count("\n") == 1, answer
    return answer.returncode, answer.stderr.strip()


def test_what_cannot_be_drawn_is_said_and_nothing_is_written(finished: tuple[calib.Client, str], tmp_path: Path) -> None:
    client, campaign = finished
    out = tmp_path / "out"
    assert refused(client, "c999", "0", "-o", out)[0] == 1
    assert refused(client, campaign, "9999", "-o", out) == (
        1, f"calibctl: campaign {campaign} has no sample 9999; `calibctl samples {campaign}` shows those it has")
    assert refused(client, campaign, "0", "--load-step", "3", "-o", out) == (2, "calibctl: --load-step 3: those of tx are 0 to 2")
    assert refused(client, campaign, "0", "--experiment", "ty", "-o", out) == (
        2, f"calibctl: --experiment ty: {campaign} has tx")
    assert not out.exists()
    code, sentence = refused(client, campaign, "0", "-o", "/proc/nowhere")
    assert code == 1 and sentence.startswith("calibctl: /proc/nowhere cannot be written: ")


def test_impacts_and_tables_have_nothing_to_draw(tmp_path: Path) -> None:
    small_campaign(tmp_path)  # writes data.csv
    (tmp_path / "parameters.csv").write_text("sample,friction\n" + "".join(f"{i},0.{i + 2}\n" for i in range(7)))
    (tmp_path / "states.csv").write_text("sample,step,axial_strain,q_over_p\n" + "".join(
        f"{sample},{step},{strain},{100 * strain + 0.1 * sample}\n"
        for sample in range(7) for step, strain in enumerate((0.0, 0.005, 0.01))))
    (tmp_path / "table.yaml").write_text(TABLE)
    with calib.connect(state=tmp_path / "state", programs=PROGRAMS, workers=0) as client:
        collisions = client.submit(impacts(tmp_path))
        assert refused(client, collisions, "0", "-o", tmp_path / "out") == (
            1, f"calibctl: no experiment of {collisions} has a packing to draw")
        assert refused(client, collisions, "0", "--experiment", "wall", "-o", tmp_path / "out") == (
            2, "calibctl: --experiment wall: collision has no packing to draw")
        table = client.submit(tmp_path / "table.yaml")
        assert refused(client, table, "0", "-o", tmp_path / "out") == (
            1, f"calibctl: the runs of {table} were made elsewhere: there is no packing to draw")
    assert not (tmp_path / "out").exists()


TABLE = """name: elsewhere
model:
  precomputed: {parameters: parameters.csv, states: states.csv}
parameters:
  friction: {prior: uniform, min: 0.1, max: 0.9}
experiments:
  - name: tx
    test: triaxial_drained
    data: {file: data.csv, strain: logarithmic}
    control: axial_strain
    observables: {q_over_p: {noise: {absolute: 0.3}}}
noise: given
inference: {method: iterative_bayesian_filter}
seed: 3
"""
