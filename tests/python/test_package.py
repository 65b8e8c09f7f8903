"""The package itself: its stubs name what there is, everything has a docstring, and nothing leaks out of the extension."""
import ast
import inspect
import os
import pathlib
import re
import shutil
import subprocess
import sys

import pytest

import rtsg
from conftest import ROOT

STUB = ROOT / "python/rtsg/__init__.pyi"


def stub_names():
    """What the stub says of each class, and of the package under ""."""
    names = {"": set()}
    for item in ast.parse(STUB.read_text()).body:
        if isinstance(item, ast.ClassDef):
            names[""].add(item.name)
            names[item.name] = {part.name for part in item.body if isinstance(part, ast.FunctionDef)}
            names[item.name] |= {part.target.id for part in item.body if isinstance(part, ast.AnnAssign)}
        elif isinstance(item, ast.FunctionDef):
            names[""].add(item.name)
        elif isinstance(item, ast.AnnAssign):
            names[""].add(item.target.id)
    return names


@pytest.mark.parametrize("name", [name for name in rtsg.__all__ if inspect.isclass(getattr(rtsg, name))])
def test_the_stub_of_a_class_names_what_it_has(name):
    made = getattr(rtsg, name)
    said = {one for one in stub_names()[name] if not one.startswith("__")}
    there = {one for one in dir(made) if not one.startswith("_")}
    if issubclass(made, tuple):
        there -= set(dir(tuple))
    if issubclass(made, dict):
        there, said = there - set(dir(dict)), said - {"types"}
    if issubclass(made, Exception):
        there, said = there - set(dir(Exception)) - set(dir(KeyError)) - {"name", "obj"}, set()
    assert said == there


def test_the_stub_names_the_whole_package():
    assert stub_names()[""] == set(rtsg.__all__)
    assert (STUB.parent / "py.typed").exists()


def test_everything_public_has_a_docstring():
    lacking = []
    for name in rtsg.__all__:
        one = getattr(rtsg, name)
        if name == "__version__":
            continue
        if not inspect.getdoc(one):
            lacking.append(name)
        if inspect.isclass(one) and not issubclass(one, (tuple, Exception)):
            lacking += [f"{name}.{part}" for part in vars(one) if not part.startswith("_") and not inspect.getdoc(getattr(one, part))]
    assert not lacking


def test_the_extension_shows_only_itself():
    symbols = subprocess.run(["nm", "-D", "--defined-only", rtsg._rtsg.__file__], capture_output=True, text=True, check=False)
    if symbols.returncode:
        pytest.skip("no nm")
    assert len(symbols.stdout.splitlines()) < 100
    assert "PyInit__rtsg" in symbols.stdout


def test_the_stub_is_typed_python():
    mypy = subprocess.run([sys.executable, "-m", "mypy", "--version"], capture_output=True, check=False)
    if mypy.returncode:
        pytest.skip("no mypy")
    checked = subprocess.run([sys.executable, "-m", "mypy", "--strict", STUB], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout


def test_a_type_checker_finds_an_option_that_there_is_not(tmp_path):
    if subprocess.run([sys.executable, "-m", "mypy", "--version"], capture_output=True, check=False).returncode:
        pytest.skip("no mypy")
    (tmp_path / "right.py").write_text('import rtsg\nscene = rtsg.load("a.x3dv")\nscene.render(width=8, integrator="path")\nfor node in scene:\n    print(node)\n')
    (tmp_path / "wrong.py").write_text('import rtsg\nscene = rtsg.load("a.x3dv")\nscene.render(integrator="pathh")\nscene.render(width=8.5)\n')
    for name, faults in (("right.py", []), ("wrong.py", ["wrong.py:3:", "wrong.py:4:"])):
        checked = subprocess.run([sys.executable, "-m", "mypy", "--strict", name], cwd=tmp_path, capture_output=True, text=True, check=False,
                                 env=dict(os.environ, MYPYPATH=str(ROOT / "python")))
        assert [re.match(r"\S+?:\d+:", line)[0] for line in checked.stdout.splitlines() if " error: " in line] == faults, checked.stdout


def test_what_pip_installs_stands_by_itself(tmp_path):
    """The component that pyproject.toml asks for, with the package's own files, away from the build."""
    build = pathlib.Path(rtsg._rtsg.__file__).parents[2]
    if not shutil.which("cmake") or not (build / "cmake_install.cmake").exists():
        pytest.skip("no cmake, or no build folder")
    subprocess.run(["cmake", "--install", build, "--component", "python", "--prefix", tmp_path], check=True, capture_output=True)
    for file in (ROOT / "python/rtsg").glob("*.py*"):
        shutil.copy(file, tmp_path / "rtsg")
    done = subprocess.run([sys.executable, "-c", """
import rtsg
scene = rtsg.loads("#X3D V4.0 utf8\\nPROFILE Immersive\\nShape { geometry Text { string \\"words\\" } }")
assert scene.render(width=64, height=36).any()
print(rtsg.__file__, *(line.split()[-1] for line in open("/proc/self/maps") if "librtsg" in line))
"""], capture_output=True, text=True, check=False, env=dict(os.environ, PYTHONPATH=str(tmp_path)))
    assert done.returncode == 0, done.stderr
    assert "librtsg_fonts.so" in done.stdout and all(path.startswith(str(tmp_path)) for path in done.stdout.split())


def test_the_versions_are_the_same():
    version = re.search(r"project\(rtsg VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text())[1]
    assert rtsg.__version__ == version and f'version = "{version}"' in (ROOT / "python/pyproject.toml").read_text()
