"""The examples as they stand, one after the other on what the one before has made."""
import os
import shutil
import subprocess
import sys
import threading

import numpy as np
import pytest

import rtsg
from conftest import ROOT

EXAMPLES = ROOT / "python/examples"
ROOM = ROOT / "examples/room.x3dv"


def run(name, *arguments, **options):
    done = subprocess.run([sys.executable, EXAMPLES / name, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False,
                          **options)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    log = tmp_path_factory.mktemp("driven") / "session.rlog"
    run("drive_scene.py", ROOM, log)
    return log


def test_each_is_about_ten_lines():
    names = sorted(path.name for path in EXAMPLES.glob("*.py"))
    assert names == ["drive_scene.py", "follow_mirror.py", "impulse_responses.py", "own_node.py", "pictures_of_log.py", "plot_log.py", "test_door.py",
                     "training_set.py"]
    for path in EXAMPLES.glob("*.py"):
        code = path.read_text().split('"""')[2]
        lines = [line for line in code.splitlines() if line.strip() and not line.startswith(("import", "from"))]
        assert len(lines) <= 10, path.name


def test_drive_scene(driven):
    log = rtsg.Log(driven)
    table = log.table("BELL.translation")
    at = table["BELL.translation"][-1]
    assert np.hypot(at[0], at[2]) == pytest.approx(1.5, abs=1e-5) and log.summary["seconds"] == pytest.approx(119 / 60)
    assert log.verify()["first_divergence"] is None


def test_plot_log(driven, tmp_path):
    pytest.importorskip("matplotlib")
    run("plot_log.py", driven, "BELL.translation", tmp_path / "plot.png", env=dict(os.environ, MPLCONFIGDIR=str(tmp_path)))
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")


def test_pictures_of_log(driven, tmp_path):
    pytest.importorskip("matplotlib")
    run("pictures_of_log.py", driven, tmp_path, env=dict(os.environ, MPLCONFIGDIR=str(tmp_path)))
    assert len(list(tmp_path.glob("*.png"))) == 2


def test_follow_mirror():
    served, ready, left = {}, threading.Event(), threading.Event()

    def serve():
        scene = rtsg.load(ROOM)
        with scene.serve() as server:
            served["endpoint"] = server.endpoint
            ready.set()
            k, end = 0, 10**9
            while not left.is_set() and k < end:
                if end == 10**9 and server.statistics["peers"]:
                    end = k + 120  # from when it is followed
                scene.frame(k / 60)
                k += 1
                server.wait(1 / 60)

    thread = threading.Thread(target=serve)
    thread.start()
    ready.wait()
    try:
        printed = run("follow_mirror.py", served["endpoint"], "BALL.translation").splitlines()
    finally:
        left.set()
        thread.join()
    assert len(printed) > 10 and printed[0].startswith("t = ")


def test_training_set(tmp_path):
    run("training_set.py", ROOM, tmp_path / "set.npz", 20)
    data = np.load(tmp_path / "set.npz")
    assert data["rgb"].shape == (20, 36, 64, 3) and data["depth"].shape == data["ids"].shape == (20, 36, 64)
    assert data["sound"].shape == (20, 1600, 2) and np.abs(data["sound"]).max() > 0
    assert len(np.unique(data["ids"])) > 3 and (data["rgb"][0] != data["rgb"][1]).any()


def test_a_recorded_door(tmp_path):
    for file in (ROOT / "examples/door.x3dv", EXAMPLES / "test_door.py"):
        shutil.copy(file, tmp_path)
    subprocess.run([os.environ["RTSG_PROGRAM"], "record", "door.x3dv", "-o", "door.rlog", "--for", "3s", "--set", "PRESSED.set_boolean=TRUE@0.5"],
                   cwd=tmp_path, check=True, capture_output=True)
    done = subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "rtsg.pytest_plugin", tmp_path],
                          capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout


def test_own_node():
    lines = run("own_node.py").splitlines()
    assert len(lines) == 31 and lines[0].endswith("+0.000 rad")
    assert float(lines[10].split()[4]) == pytest.approx(.5 * np.sin(np.sqrt(9.81 / 2)), abs=1e-3)


def test_impulse_responses(tmp_path):
    lines = run("impulse_responses.py", ROOM, tmp_path / "responses.npz").splitlines()
    responses = np.load(tmp_path / "responses.npz")
    assert len(lines) == len(responses.files) == 5 and "+-" in lines[0]
    first = [np.abs(responses[name]).argmax() for name in responses.files]
    assert len(set(first)) > 1 and all(np.isfinite(responses[name]).all() for name in responses.files)
