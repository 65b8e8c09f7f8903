"""Replay tests, and the fixture rtsg_replay in a pytest of its own."""
import os
import shutil
import subprocess
import sys

import pytest

import rtsg
from conftest import ROOT


@pytest.fixture
def session(tmp_path):
    """A folder with the door's scene and a session in which its button is pressed."""
    shutil.copy(ROOT / "examples/door.x3dv", tmp_path)
    scene = rtsg.load(tmp_path / "door.x3dv")
    with scene.record(tmp_path / "door.rlog"):
        for k in range(91):
            if k == 15:
                scene.send("PRESSED.set_boolean", True)
            scene.frame(k / 30)
    return tmp_path


def change(folder, old, new):
    text = (folder / "door.x3dv").read_text()
    assert old in text
    (folder / "door.x3dv").write_text(text.replace(old, new))


def test_the_same_scene_passes(session):
    for scene in (None, session / "door.x3dv"):
        report = rtsg.replay_test(session / "door.rlog", scene=scene)
        assert report.passed and report.frames == report.verified > 90 and report.divergence is None


def test_a_changed_scene_is_named(session):
    change(session, "0 -1 0 1.2,", "0 -1 0 1.1,")
    report = rtsg.replay_test(session / "door.rlog", scene=session / "door.x3dv")
    assert not report.passed and report.divergence.node == "SWING" and report.divergence.field == "keyValue"
    chosen = rtsg.replay_test(session / "door.rlog", scene=session / "door.x3dv", fields=["DOOR.*"])
    assert [(d.node, d.field) for d in chosen.differences] == [("DOOR", "rotation")] and chosen.differences[0].largest > .01
    assert rtsg.replay_test(session / "door.rlog", scene=session / "door.x3dv", fields=["DOOR.*"], tolerance=.2).passed


def test_a_scene_that_a_function_builds(session):
    built = []

    def build(scene):
        scene.add((session / "door.x3dv").read_text().partition("NavigationInfo")[1]
                  + (session / "door.x3dv").read_text().partition("NavigationInfo")[2])
        built.append(scene)

    report = rtsg.replay_test(session / "door.rlog", scene=build, fields=["DOOR.rotation", "LAMP.on"], tolerance=1e-6)
    assert report.passed, report
    with pytest.raises(rtsg.Closed):
        built[0]["DOOR"]


def test_what_a_function_raises_comes_out(session):
    def fails(*_):
        raise LookupError("mine")

    for which in ("scene", "check", "application"):
        options = {"scene": session / "door.x3dv", which: fails}
        with pytest.raises(LookupError, match="mine"):
            rtsg.replay_test(session / "door.rlog", **options)


def test_an_application_sends_what_it_sent_before(session):
    scene = rtsg.load(session / "door.x3dv")
    with scene.record(session / "door.rlog"):
        for k in range(31):
            scene["LAMP"].intensity = k / 31
            scene.frame(k / 30)

    def application(now, t):
        now["LAMP"].intensity = round(t * 30) / factor

    factor = 31
    assert rtsg.replay_test(session / "door.rlog", scene=session / "door.x3dv", application=application).passed
    factor = 32
    report = rtsg.replay_test(session / "door.rlog", scene=session / "door.x3dv", application=application)
    assert not report.passed and report.divergence.field == "intensity"


def test_a_log_is_written_anew(session):
    change(session, "0 -1 0 1.2,", "0 -1 0 1.1,")
    assert rtsg.replay_test(session / "door.rlog", scene=session / "door.x3dv", update=True).updated
    assert rtsg.replay_test(session / "door.rlog", scene=session / "door.x3dv").passed


def test_what_cannot_be_run(session):
    with pytest.raises(rtsg.Error):
        rtsg.replay_test(session / "missing.rlog")
    with pytest.raises(rtsg.Error, match="NODE.field"):
        rtsg.replay_test(session / "door.rlog", scene=session / "door.x3dv", fields=["DOOR"])
    with pytest.raises(rtsg.Error):
        rtsg.replay_test(session / "door.rlog", scene=session / "missing.x3dv")


def pytest_of_its_own(folder, *options):
    return subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "rtsg.pytest_plugin", "--basetemp",
                           folder / "made", "--junitxml", folder / "junit.xml", *options, folder],
                          capture_output=True, text=True, timeout=120, check=False, cwd=folder)


def test_the_fixture_passes_and_fails_with_a_page(session):
    shutil.copy(ROOT / "python/examples/test_door.py", session)
    done = pytest_of_its_own(session)
    assert done.returncode == 0, done.stdout
    change(session, "0 -1 0 1.2,", "0 -1 0 1.0,")
    done = pytest_of_its_own(session)
    assert done.returncode == 1 and "DOOR.rotation from frame" in done.stdout, done.stdout
    assert "Traceback" not in done.stdout
    if os.environ.get("RTSG_PROGRAM"):
        page = next((session / "made").rglob("replay.html"))
        assert "DOOR" in page.read_text() and f'name="rtsg_page" value="{page}"' in (session / "junit.xml").read_text()
    assert pytest_of_its_own(session, "--rtsg-update").returncode == 0
    assert pytest_of_its_own(session).returncode == 0


def test_the_fixture_names_a_log_that_is_missing(session):
    (session / "test_it.py").write_text("def test_it(rtsg_replay):\n    rtsg_replay('missing.rlog')\n")
    done = pytest_of_its_own(session)
    assert done.returncode == 1 and "missing.rlog" in done.stdout and "Error" not in done.stdout.split("short test summary")[0].replace("rtsg.Error", ""), done.stdout
