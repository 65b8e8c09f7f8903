"""Logs: written, gone through, as columns, compared, and damaged."""
import csv
import io
import json
import os
import subprocess
import warnings

import numpy as np
import pytest

import rtsg
from conftest import MOVING


@pytest.fixture
def recorded(moving, tmp_path):
    """Two seconds at 30 Hz; at the first second a lamp comes, at 1.5 it goes."""
    path = tmp_path / "session.rlog"
    with moving.record(path):
        for k in range(61):
            if k == 30:
                added = moving.add("DEF LAMP PointLight { on FALSE intensity .5 } DEF CHOICE Switch { whichChoice 300 }")
            if k == 45:
                for node in added:
                    moving.remove(node)
            if k == 20:
                moving.send("BOX.rotation", (0, 1, 0, 1), author="anna")
            moving.frame(k / 30)
    return path


def test_every_state_is_in_the_log(recorded, moving):
    log = rtsg.Log(recorded)
    report = log.verify()
    assert report["states"] == report["verified"] == moving.number and report["first_divergence"] is None
    assert log.summary["states"] == report["states"] and log.summary["closed"] and log.damage == [] and log.summary["seconds"] == 2
    log.seek(2)
    assert log.at_end and log.scene.hash == moving.hash and log.time == 2


def test_going_through_states(recorded):
    log = rtsg.Log(recorded)
    times = [log.time for changes in log.states(start=.5, stop=1)]
    assert times == pytest.approx([k / 30 for k in range(15, 31)])
    places = [log.scene["BOX"].translation[0] for _ in log.states(every=10)]
    assert len(places) == 7 and places == sorted(places)
    numbers = [changes.number for changes in log.states()]
    assert numbers == list(range(1, 63))
    log.seek(1.2)
    assert "LAMP" in log.scene
    log.seek(.2)
    assert "LAMP" not in log.scene


def test_columns(recorded):
    table = rtsg.Log(recorded).table("BOX.translation", "LAMP.*", "CHOICE.whichChoice", "CLOCK.isActive", "VIEW.description", "WAY.key", "BOX.children")
    rows = len(table["time"])
    assert rows == 62 and table["BOX.translation"].shape == (rows, 3) and table["BOX.translation"].dtype == np.float32
    assert np.allclose(table["BOX.translation"][:, 0], 2 * table["time"], atol=1e-6)
    there = (table["time"] >= 1) & (table["time"] < 1.5)
    assert np.array_equal(np.isnan(table["LAMP.intensity"]), ~there) and np.array_equal(np.isnan(table["LAMP.on"]), ~there)
    assert (table["CHOICE.whichChoice"][there] == 300).all() and np.isnan(table["CHOICE.whichChoice"][~there]).all()
    assert not table["LAMP.on"][there].any()
    assert table["CLOCK.isActive"].dtype == bool and table["VIEW.description"].dtype == object
    assert table["WAY.key"][-1].tolist() == [0, 1] and table["BOX.children"][0][0].startswith("#")
    assert table.types["BOX.translation"] == "SFVec3f"


def test_a_part_of_the_columns(recorded):
    log = rtsg.Log(recorded)
    table = log.table("*.translation", start=1, stop=1.5, every=5)
    assert list(table) == ["time", "BOX.translation"]
    assert table["time"] == pytest.approx(np.arange(30, 46, 5) / 30)
    assert log.time == 0
    for wrong in ("NOBODY.translation", "BOX.nothing"):
        with pytest.raises(rtsg.NoSuchName, match=wrong.replace(".", r"\.")):
            log.table(wrong)
    with pytest.raises(rtsg.Error, match="NODE.field"):
        log.table("BOX")
    with pytest.raises(ValueError):
        log.table()


def test_one_number_a_column(recorded):
    table = rtsg.Log(recorded).table("BOX.rotation", "PAINT.diffuseColor", "CLOCK.isActive")
    flat = table.flat()
    assert list(flat) == ["time", "BOX.rotation.x", "BOX.rotation.y", "BOX.rotation.z", "BOX.rotation.angle",
                          "PAINT.diffuseColor.r", "PAINT.diffuseColor.g", "PAINT.diffuseColor.b", "CLOCK.isActive"]
    assert flat["BOX.rotation.angle"][-1] == 1 and flat["PAINT.diffuseColor.r"].tolist() == [1] * 62


def test_a_data_frame(recorded):
    pandas = pytest.importorskip("pandas")
    frame = rtsg.Log(recorded).table("BOX.translation").frame()
    assert isinstance(frame, pandas.DataFrame) and frame.index.name == "time" and len(frame) == 62


def test_who_changed_what(recorded):
    steps = rtsg.Log(recorded).blame("BOX.rotation")
    assert [step.author for step in steps] == ["", "anna"] and steps[1].time == pytest.approx(20 / 30)
    log = rtsg.Log(recorded)
    authors = [change.author for changes in log.states(start=.6, stop=.7) for change in changes if change.field == "rotation"]
    assert "anna" in authors


def test_the_scene_keeps_its_log_and_its_server(moving, tmp_path):
    moving.record(tmp_path / "a.rlog")
    endpoint = moving.serve().endpoint
    for k in range(3):
        moving.frame(k)
    assert rtsg.follow(endpoint).wait(number=moving.number).hash == moving.hash
    moving.close()
    assert rtsg.Log(tmp_path / "a.rlog").verify()["states"] == 4


def test_two_logs_are_compared(recorded, tmp_path):
    assert rtsg.diff(recorded, recorded) is None
    scene = rtsg.loads(MOVING)
    with scene.record(tmp_path / "other.rlog"):
        for k in range(61):
            scene.frame(k / 30)
    assert rtsg.diff(recorded, tmp_path / "other.rlog").frame > 1


def test_damage_is_named_and_skipped(recorded):
    data = bytearray(recorded.read_bytes())
    middle = len(data) // 2
    data[middle:middle + 40] = b"\xff" * 40
    recorded.write_bytes(data)
    log = rtsg.Log(recorded)
    with pytest.warns(rtsg.DiagnosticWarning, match="session.rlog"):
        while log.step():
            pass
    assert log.damage and log.damage[0].length > 0 and log.verify()["first_divergence"] is not None
    with pytest.warns(rtsg.DiagnosticWarning):
        log.table("BOX.translation")


def test_what_cannot_be(moving, tmp_path):
    with pytest.raises(rtsg.Error, match="missing.rlog"):
        rtsg.Log(tmp_path / "missing.rlog")
    (tmp_path / "text.rlog").write_text("no log")
    with pytest.raises(rtsg.Error):
        rtsg.Log(tmp_path / "text.rlog")
    with pytest.raises(rtsg.Error, match="output|nowhere"):
        moving.record(tmp_path / "nowhere" / "a.rlog")
    recorder = moving.record(tmp_path / "a.rlog")
    recorder.close()
    recorder.close()
    with pytest.raises(rtsg.Error, match="already|exists"):
        moving.record(tmp_path / "a.rlog", replace=False)
    log = rtsg.Log(tmp_path / "a.rlog")
    log.close()
    with pytest.raises(rtsg.Closed):
        log.step()


def test_a_log_that_cannot_be_written_is_told(moving, tmp_path):
    """Its file goes while it is written: the log ends, the scene goes on, and the end says so."""
    recorder = moving.record(tmp_path / "a.rlog", keyframe_seconds=.1)
    moving.frame(0)
    (tmp_path / "a.rlog").unlink()
    with pytest.raises(rtsg.Error, match="a.rlog"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for k in range(1, 200):
            moving.frame(k / 10)
        recorder.close()
    moving.frame(100)
    moving.record(tmp_path / "b.rlog")
    moving.frame(101)
    (tmp_path / "b.rlog").unlink()
    with pytest.warns(rtsg.DiagnosticWarning, match="b.rlog"):
        moving.close()


def test_the_program_writes_the_same_table(recorded, tmp_path):
    fields = ["BOX.translation", "LAMP.on", "PAINT.diffuseColor", "CLOCK.isActive"]
    command = [os.environ["RTSG_PROGRAM"], "replay", recorded, "--table", ",".join(fields), "--seek", "0.5", "--for", "1.2", "--every", "3"]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    reported = subprocess.run([*command, "-o", tmp_path / "a.csv", "--json"], capture_output=True, text=True, check=True).stdout
    assert (tmp_path / "a.csv").read_text() == printed
    table = rtsg.Log(recorded).table(*fields, start=.5, stop=1.7, every=3)
    assert json.loads(reported) == {"rows": len(table["time"]), "columns": 4, "complete": True}
    names, *rows = csv.reader(io.StringIO(printed))
    flat = table.flat()
    assert names == list(flat) and len(rows) == 13
    for name, column in zip(names, zip(*rows)):
        as_numbers = [{"true": 1., "false": 0., "": np.nan}[cell] if cell in ("true", "false", "") else float(cell) for cell in column]
        assert np.array_equal(np.array(as_numbers, dtype=flat[name].dtype), flat[name], equal_nan=flat[name].dtype.kind == "f"), name


@pytest.mark.parametrize("options, status, words", [
    (["--table", "BOX.nothing"], 1, "no state has a field BOX.nothing"), (["--table", "BOX"], 1, "expected NODE.field"),
    (["--table", "BOX.*", "-o", "a.txt"], 2, ".csv"), (["-o", "a.csv"], 2, "--table"), (["--table", "BOX.*", "--json"], 2, "-o names a file"),
    (["--table", "BOX.*", "--render", "a.png"], 2, "--table"),
])
def test_what_the_program_cannot_write(recorded, options, status, words):
    done = subprocess.run([os.environ["RTSG_PROGRAM"], "replay", recorded, *options], capture_output=True, text=True, check=False)
    assert done.returncode == status and words in done.stderr and done.stdout == ""


def test_two_sessions_in_one_file(recorded, tmp_path):
    """Logs that stand one behind the other: nodes of the first are not there in the second."""
    other = rtsg.loads("#X3D V4.0 utf8\nPROFILE Immersive\nDEF FIRST Group { }\nDEF OTHER Transform { translation 7 7 7 }")
    with other.record(tmp_path / "other.rlog"):
        for k in range(5):
            other["OTHER"].translation = 7, 7, k
            other.frame(k)
    both = tmp_path / "both.rlog"
    both.write_bytes(recorded.read_bytes() + (tmp_path / "other.rlog").read_bytes())
    table = rtsg.Log(both).table("BOX.translation", "OTHER.translation")
    here = np.isnan(table["OTHER.translation"][:, 0])
    assert here.sum() == 62 and len(here) > 66 and np.array_equal(np.isnan(table["BOX.translation"][:, 0]), ~here)
    assert table["OTHER.translation"][-1].tolist() == [7, 7, 4]
