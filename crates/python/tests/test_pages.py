"""The notebook and the examples of docs/python.md."""

import re

import nbformat
from nbclient import NotebookClient

import organza

from conftest import ROOT


def test_notebook(tmp_path):
    notebook = nbformat.read(ROOT / "docs" / "python" / "draft_to_material.ipynb", as_version=4)
    assert all(not cell.get("outputs") for cell in notebook.cells), "clear the outputs"
    client = NotebookClient(
        notebook, timeout=1200, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
    )
    client.execute()
    picture = (tmp_path / "draft_to_material.png").read_bytes()
    assert picture.startswith(b"\x89PNG") and len(picture) > 10_000
    fitted = organza.load(tmp_path / "fitted_twill.toml")
    assert isinstance(fitted, organza.Fabric) and "surface" in fitted
    # The fitted surface reflects within a factor of two of the volume, in the blue.
    names = next(c for c in notebook.cells if "fitted[\"words\"]" in c.source)
    words = names.outputs[0].text
    error = float(re.search(r"median error ([\d.]+) %", words).group(1))
    assert error < 50, words


def test_examples_of_the_page(tmp_path, monkeypatch, capsys):
    page = (ROOT / "docs" / "python.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(blocks) >= 6
    (tmp_path / "scenes").symlink_to(ROOT / "scenes")
    monkeypatch.chdir(tmp_path)
    names = {}
    for block in blocks:
        exec(compile(block, "docs/python.md", "exec"), names)
    printed = capsys.readouterr().out
    assert "(64, 64, 3) float32" in printed
    assert "<scene> | camera.widht_mm" in printed.replace("camera | ", "camera.widht_mm | ")
    assert (tmp_path / "my_satin.ovox").exists()


def test_readme_of_the_package(tmp_path, monkeypatch, capsys):
    page = (ROOT / "crates" / "python" / "README.md").read_text()
    (block,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(compile(block, "README.md", "exec"), {})
    assert capsys.readouterr().out.strip().endswith(", 3)")
