"""`pip install ./python`: what the backend asks CMake for, and the wheel that it writes."""
import importlib.util
import pathlib
import shutil
import subprocess
import sys
import zipfile

import pytest

import rtsg
from conftest import ROOT


@pytest.fixture
def backend(monkeypatch):
    spec = importlib.util.spec_from_file_location("wheel_backend", ROOT / "python/wheel_backend.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.asked = []

    def run(*command):  # in the place of CMake
        module.asked.append([str(word) for word in command])
        if "--install" in command:
            into = pathlib.Path(command[command.index("--prefix") + 1]) / "rtsg"
            into.mkdir(parents=True)
            shutil.copy(rtsg._rtsg.__file__, into)
            for name in ("catalogue.bin", "words.bin"):
                shutil.copy(ROOT / "sync" / name, into)

    monkeypatch.setattr(module, "run", run)
    monkeypatch.delenv("RTSG_BUILD", raising=False)
    return module


def test_a_wheel_holds_the_extension_and_the_packages_own_files(backend, tmp_path):
    name = backend.build_wheel(tmp_path)
    with zipfile.ZipFile(tmp_path / name) as wheel:
        names = set(wheel.namelist())
        about = next(one for one in names if one.endswith("METADATA")).rpartition("/")[0]
        metadata = wheel.read(f"{about}/METADATA").decode()
        record = wheel.read(f"{about}/RECORD").decode().splitlines()
        assert "rtsg.pytest_plugin" in wheel.read(f"{about}/entry_points.txt").decode()
    assert {"rtsg/__init__.py", "rtsg/__init__.pyi", "rtsg/pure.py", "rtsg/py.typed", "rtsg/catalogue.bin", "rtsg/words.bin"} <= names
    assert any(one.startswith("rtsg/_rtsg") for one in names) and {line.split(",")[0] for line in record} == names
    assert "Requires-Dist: numpy" in metadata and f"Version: {rtsg.__version__}" in metadata
    configure, build, _ = backend.asked
    assert f"-DPython_EXECUTABLE={sys.executable}" in configure and "rtsg_python" in build
    if subprocess.run([sys.executable, "-m", "pip", "--version"], capture_output=True, check=False).returncode:
        pytest.skip("no pip")
    subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--no-compile", "--target", tmp_path / "there",
                    tmp_path / name], check=True, capture_output=True)
    done = subprocess.run([sys.executable, "-c", "import rtsg; print(rtsg.native, len(rtsg.Scene()))"], capture_output=True, text=True, check=False,
                          env={"PYTHONPATH": str(tmp_path / "there")})
    assert done.stdout == "True 1\n", done.stderr


def test_a_build_folder_that_is_there_is_taken(backend, tmp_path):
    backend.build_wheel(tmp_path, {"build": "/somewhere"})
    assert all("-S" not in command for command in backend.asked) and "/somewhere" in backend.asked[0]
    with pytest.raises(RuntimeError, match="checkout"):
        backend.build_sdist(tmp_path)


def test_the_same_files_make_the_same_wheel_at_any_time(backend, tmp_path, monkeypatch):
    made = []
    for year in (2020, 2030):
        folder = tmp_path / str(year)
        folder.mkdir()
        monkeypatch.setattr("time.time", lambda year=year: (year - 1970) * 31_556_952.0)
        name = backend.write_wheel(folder, backend.project(), {"rtsg/__init__.py": b"text\n"}, "cp311", "any")
        made.append((folder / name).read_bytes())
        with zipfile.ZipFile(folder / name) as wheel:
            assert {entry.date_time[0] for entry in wheel.infolist()} == {1980}
    assert made[0] == made[1]
