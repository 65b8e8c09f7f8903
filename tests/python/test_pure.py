"""The reader and follower in Python alone (rtsg.pure): it passes the conformance set, agrees with the extension, and stands in for it."""
import asyncio
import ctypes
import ctypes.util
import json
import os
import pathlib
import random
import shutil
import struct
import subprocess
import sys
import warnings

import numpy as np
import pytest

import rtsg
from conftest import MOVING, ROOT
from rtsg import pure
from test_mirrors import Origin
from test_random_programs import Program

CONFORMANCE = ROOT / "tests/sync/conformance"
LOGS = sorted(str(path.relative_to(CONFORMANCE)) for path in CONFORMANCE.rglob("*.rlog"))
SESSIONS = sorted(path.stem for path in CONFORMANCE.glob("mirror/*.session"))


def same(given, expected):
    """Expected numbers are the shortest decimals of f32 or f64; what is no number is null."""
    if isinstance(expected, list):
        flat = [one for row in expected for one in row] if expected and isinstance(expected[0], list) and not (given and isinstance(given[0], list)) else expected
        return isinstance(given, list) and len(given) == len(flat) and all(map(same, given, flat))
    if expected is None:
        return not np.isfinite(given) or given == 0
    if isinstance(expected, float) or isinstance(given, float):
        return given == expected or given == float(np.float32(expected))
    return given == expected


def expect_last(scene, expected):
    dump = scene.dump()
    assert (dump["state"], dump["hash"], dump["routes"]) == (expected["state"], expected["hash"], expected["routes"])
    assert list(dump["nodes"]) == list(expected["nodes"])
    for n, node in expected["nodes"].items():
        assert {k: v for k, v in dump["nodes"][n].items() if k != "fields"} == {k: v for k, v in node.items() if k != "fields"}
        assert dump["nodes"][n]["fields"].keys() == node["fields"].keys()
        for field, value in node["fields"].items():
            assert same(dump["nodes"][n]["fields"][field], value), f"{n}.{field}"


def test_the_set_is_whole():
    assert len(LOGS) == 28 and len(SESSIONS) == 12


@pytest.mark.filterwarnings("ignore::rtsg.DiagnosticWarning")
@pytest.mark.parametrize("name", LOGS)
def test_a_log_of_the_conformance_set(name):
    expected = json.loads((CONFORMANCE / name).with_suffix(".json").read_text(encoding="utf-8"))
    log, states, more = pure.Log(CONFORMANCE / name), [], True
    while more:
        assert log.scene.hash == log.record.hash
        states.append([log.scene.number, log.scene.hash])
        more = log.step()
    assert states == expected["states"] and log.verified == len(states)
    assert log.gaps == expected["gaps"] and log.was_closed == expected["closed"]
    assert [{"offset": place.offset, "length": place.length} for place in log.damage] == expected["damage"]
    assert log.unclosed_sessions == expected.get("unclosed_sessions", 0)
    expect_last(log.scene, expected["last"])


@pytest.mark.parametrize("name", SESSIONS)
def test_a_session_of_the_conformance_set(name):
    expected = json.loads((CONFORMANCE / f"mirror/{name}.json").read_text(encoding="utf-8"))
    hellos, asked = [], 0

    def send(first, _):
        if first[5] == 1:
            hellos.append(list(struct.unpack_from("<QQ", first, 24)))

    session, states, left = pure.Session(send), [], False
    for line in (CONFORMANCE / f"mirror/{name}.session").read_text().splitlines():
        who, *parts = line.split(" ")
        if who == "cut":
            session.cut()
            continue
        first, second = (bytes.fromhex(part) for part in (parts + [""])[:2])
        if who == "client" and first[5] == 1:
            asked += 1
            if len(hellos) < asked:
                session.hello()
        elif who == "client" and first[5] == 9:
            session.submit(second)
        elif who == "client" and first[5] == 10:
            session.control(first[17:].decode())
        elif who == "server":
            if len(first) >= 16 and first[5] in (16, 17, 20, 21, 22, 23) and struct.unpack_from("<Q", first, 8)[0] >= 1000:
                first = first[:8] + session.session.to_bytes(8, "little") + first[16:]
            session.receive(first, second)
            assert len(hellos) <= asked + 1
            for changes in session.sets:
                assert changes.hash == session.scene.hash
                if not states or states[-1][0] != changes.number:
                    states.append([changes.number, session.scene.hash])
            session.sets, left = [], left or session.gone
    assert states == expected["states"] and hellos == expected["hellos"]
    assert [{"request": v.request, "state": v.state, "refusal": v.refusal, "created": list(v.created.values()), "kept": v.kept}
            for v in session.verdicts] == expected["verdicts"]
    assert (session.replies, session.refusal, left) == (expected["replies"], expected["refused"], expected["left"])
    expect_last(session.scene, expected["last"])


def test_the_hashes_are_xxh3():
    library = ctypes.util.find_library("xxhash")
    if not library:
        pytest.skip("no libxxhash")
    library = ctypes.CDLL(library)

    class Wide(ctypes.Structure):
        _fields_ = [("low", ctypes.c_uint64), ("high", ctypes.c_uint64)]

    library.XXH3_64bits.restype, library.XXH3_64bits.argtypes = ctypes.c_uint64, [ctypes.c_char_p, ctypes.c_size_t]
    library.XXH3_128bits_withSeed.restype = Wide
    library.XXH3_128bits_withSeed.argtypes = [ctypes.c_char_p, ctypes.c_size_t, ctypes.c_uint64]
    dice = random.Random(4)
    for size in [*range(300), 1023, 1024, 1025, 2048, 2049, 10_000]:
        data, seed = dice.randbytes(size), dice.getrandbits(64)
        wide = library.XXH3_128bits_withSeed(data, size, seed)
        assert pure.xxh3_64(data) == library.XXH3_64bits(data, size), size
        assert pure.xxh3_128(data, seed) == wide.low | wide.high << 64, size


@pytest.mark.filterwarnings("ignore::rtsg.DiagnosticWarning")
@pytest.mark.parametrize("seed", range(3))
def test_random_sessions_are_read_as_the_extension_reads_them(seed, tmp_path):
    program = Program(seed)
    recorder = program.scene.record(tmp_path / "a.rlog", inputs=seed == 1, keyframe_seconds=1)
    while len(program.hashes) < 30:
        program.step()
    recorder.close()
    native, log = rtsg.Log(tmp_path / "a.rlog"), pure.Log(tmp_path / "a.rlog")
    more = True
    while more:
        assert (log.scene.number, log.scene.hash, log.time) == (native.scene.number, native.scene.hash, native.time)
        assert {change.kind for change in log.changes} == {change.kind for change in native.changes if change.kind != "define_type"}
        more = log.step()
        assert native.step() == more
    for node in native.scene.nodes():
        for name, kind in node.field_types.items():
            try:
                value = node[name]
            except rtsg.Error:
                with pytest.raises(rtsg.Error):
                    log.scene.node(node.node_id)[name]
                continue
            own = log.scene.node(node.node_id)[name]
            if kind[2:] == "Node":
                assert repr(own) == repr(value)
            else:
                np.testing.assert_array_equal(np.asarray(own), np.asarray(value), f"{node}.{name}")
                assert np.asarray(own).dtype == np.asarray(value).dtype, f"{node}.{name}"


def recorded(tmp_path, frames=120):
    scene = rtsg.loads(MOVING)
    with scene.record(tmp_path / "a.rlog", keyframe_seconds=.5):
        for k in range(frames):
            if k == 60:
                scene.add("DEF LATE Transform { }")
            scene.frame(k / 60)
    return tmp_path / "a.rlog"


def test_seeking_states_and_tables_are_those_of_the_extension(tmp_path):
    path = recorded(tmp_path)
    native, log = rtsg.Log(path), pure.Log(path)
    for seconds in (1.3, .2, 0, 5, .75):
        native.seek(seconds)
        log.seek(seconds)
        assert (log.time, log.scene.hash, log.at_end) == (native.time, native.scene.hash, native.at_end)
    span = {"start": .5, "stop": 1.2, "every": 7}
    assert [changes.number for changes in log.states(**span)] == [changes.number for changes in native.states(**span)]
    for paths, options in ((("BOX.translation", "LATE.*", "PAINT.diffuseColor"), {}), (("*.translation", "CLOCK.*"), span)):
        theirs, own = native.table(*paths, **options), log.table(*paths, **options)
        assert list(own) == list(theirs) and own.types == theirs.types and list(own.flat()) == list(theirs.flat())
        for name, column in theirs.items():
            if column.dtype == object:
                assert [np.asarray(a).tolist() for a in own[name]] == [np.asarray(a).tolist() for a in column], name
            else:
                np.testing.assert_array_equal(own[name], column, name)
                assert own[name].dtype == column.dtype, name
    assert log.verify() == native.verify() and log.scene.routes == native.scene.routes
    with pytest.raises(rtsg.NoSuchName):
        log.table("NOBODY.translation")


def test_what_is_not_whole_is_said(tmp_path):
    data = bytearray(recorded(tmp_path).read_bytes())
    data[len(data) // 2] ^= 1
    path = tmp_path / "b.rlog"
    path.write_bytes(data[:-20])
    with pytest.warns(rtsg.DiagnosticWarning, match="damaged"):
        log = pure.Log(path)
        while log.step():
            pass
    said = log.verify()
    assert said["damaged"] == 2 and said["first_divergence"] is not None and said["verified"] == said["states"]
    assert len(log.damage) == 2 and log.damage == [d._replace(text=own.text) for d, own in zip(rtsg.Log(path).damage, log.damage)]
    (tmp_path / "c.rlog").write_bytes(b"nothing")
    with pytest.raises(rtsg.Error, match="no intact state"):
        pure.Log(tmp_path / "c.rlog")
    with pytest.raises(rtsg.Error, match="cannot be read"):
        pure.Log(tmp_path / "d.rlog")


def payloads(data):
    at = 0
    while at + 64 <= len(data):
        size = int.from_bytes(data[at + 18:at + 24], "little")
        yield at, size
        at += 64 + size


@pytest.mark.parametrize("name", ["smallest", "arrays", "scene", "edits", "lossy", "document"])
def test_hostile_bytes_are_refused_and_never_crash(name, tmp_path):
    dice, data = random.Random(name), (CONFORMANCE / f"{name}.rlog").read_bytes()
    places = [place for place in payloads(data) if place[1]]
    for _ in range(60):
        wrong = bytearray(data)
        at, size = dice.choice(places)
        for _ in range(dice.randint(1, 3)):
            wrong[at + 64 + dice.randrange(size)] = dice.randrange(256)
        wrong[at + 8:at + 16] = pure.xxh3_64(bytes(wrong[at + 16:at + 64 + size])).to_bytes(8, "little")  # so that it is believed
        (tmp_path / "a.rlog").write_bytes(wrong)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                log = pure.Log(tmp_path / "a.rlog")
                log.verify()
                log.scene.dump()
            except rtsg.Error:
                pass


def test_a_record_that_takes_too_much_is_refused(tmp_path):
    count = 10**9
    block = bytes([4]) + pure._varint(count)
    body = bytes([3, 0, 5, 0])
    record = pure._request_record(block + pure._varint(len(body)) + body, 3)
    with pytest.raises(rtsg.Error, match="more memory"):
        pure._Decoder().decode(pure._Record(record), pure.Scene())


# ---- mirrors -----------------------------------------------------------------------------------------------------------


def test_a_follower_gets_every_frame_and_the_origins_hash():
    pytest.importorskip("zmq")
    with Origin(frames=60, peers=1) as origin:
        follower = pure.follow(origin.endpoint, name="anna")
        numbers = [changes.number for changes in follower]
    assert numbers == list(range(numbers[0], numbers[-1] + 1)) and follower.server_left
    assert follower.scene.hash == origin.hash and follower.statistics["divergences"] == 0
    assert follower.scene["BOX"].translation[0] > 0


def test_a_follower_is_an_asynchronous_iterator():
    pytest.importorskip("zmq")

    async def follow(endpoint):
        return sum([len(changes) > 0 async for changes in pure.follow(endpoint)])

    async def both(endpoint):
        return await asyncio.gather(follow(endpoint), follow(endpoint))

    with Origin(frames=40, peers=2) as origin:
        assert min(asyncio.run(both(origin.endpoint))) > 10


def test_edits_events_undo_and_locks_go_upstream():
    pytest.importorskip("zmq")
    with Origin(upstream="edits") as origin, pure.follow(origin.endpoint, name="anna") as anna, rtsg.follow(origin.endpoint, name="bert") as bert:
        scene = anna.wait()
        anna.wait_for(anna.edit("PAINT.diffuseColor", (0, 1, 0)))
        assert scene["PAINT"].diffuseColor.tolist() == [0, 1, 0]
        anna.wait_for(anna.undo())
        assert scene["PAINT"].diffuseColor.tolist() == [1, 0, 0]
        anna.wait_for(anna.redo())
        anna.wait_for(anna.send("CLOCK.enabled", False))
        assert scene["CLOCK"].enabled is False
        anna.wait_for(anna.edit("WAY.keyValue", np.ones((3, 3))))
        assert scene["WAY"].keyValue.tolist() == [[1, 1, 1]] * 3
        anna.wait_for(anna.edit("VIEW.description", "Grüße"))
        shape = scene["BOX"].children[0]
        anna.wait_for(anna.edit("BOX.children", []))
        assert scene["BOX"].children == ()
        anna.wait_for(anna.edit("BOX.children", [shape]))
        assert scene["BOX"].children == (shape,)
        anna.wait_for(anna.lock(["PAINT"], 30))
        bert.wait()
        assert bert.scene["VIEW"].description == "Grüße"
        with pytest.raises(rtsg.Error, match="refused"):
            bert.wait_for(bert.edit("PAINT.diffuseColor", (0, 0, 0)))
        anna.wait_for(anna.lock(["PAINT"], 0))
        bert.wait_for(bert.edit("PAINT.diffuseColor", (0, 0, 0)))
        for wrong, error in ((("PAINT.diffuseColor", "green"), TypeError), (("CLOCK.enabled", 1), TypeError), (("BOX.scale", (1, 2)), ValueError),
                             (("NOBODY.scale", 1), rtsg.NoSuchName)):
            with pytest.raises(error):
                anna.edit(*wrong)
        with pytest.raises(rtsg.Error, match="not edited here"):
            scene["BOX"].scale = 1, 1, 1


def test_what_cannot_be():
    pytest.importorskip("zmq")
    with pytest.raises(rtsg.Error):
        pure.follow("nonsense")
    with pytest.raises(rtsg.Error, match="not in step"):
        pure.follow("tcp://127.0.0.1:1").wait(.2)
    with pytest.raises(rtsg.NoExtension):
        pure.follow("tcp://127.0.0.1:1", keys="keys")
    follower = pure.follow("tcp://127.0.0.1:1")
    follower.close()
    with pytest.raises(rtsg.Closed):
        follower.poll()


# ---- in the place of the extension ---------------------------------------------------------------------------------------

@pytest.fixture
def alone(tmp_path):
    """The package without its extension, and a way to run a program with it."""
    (tmp_path / "alone/rtsg").mkdir(parents=True)
    for file in [*pathlib.Path(rtsg.__file__).parent.glob("*.py"), ROOT / "sync/catalogue.bin", ROOT / "sync/words.bin"]:
        shutil.copy(file, tmp_path / "alone/rtsg")

    def run(*arguments):
        return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=False, timeout=60, env={"PYTHONPATH": str(tmp_path / "alone")})
    run.folder = tmp_path / "alone"
    return run


def test_the_package_says_that_it_is_alone_and_raises_for_the_rest(alone, tmp_path):
    done = alone("-c", f"""
import rtsg
assert rtsg.native is False and "load" not in rtsg.__all__
log = rtsg.Log({str(recorded(tmp_path))!r})
assert log.table("BOX.translation")["BOX.translation"].shape[0] >= 120
for call in (lambda: rtsg.load, lambda: log.scene.render(), lambda: log.blame("BOX.translation"), lambda: rtsg.serve):
    try:
        call()
    except rtsg.NoExtension as error:
        assert "extension" in str(error)
    else:
        raise SystemExit("silently less")
try:
    from rtsg import load
except ImportError:
    print("fine")
""")
    assert done.stdout == "fine\n", done.stderr


def test_an_extension_that_cannot_be_loaded_is_an_error(alone, tmp_path):
    (tmp_path / "alone/rtsg" / pathlib.Path(rtsg._rtsg.__file__).name).write_bytes(b"no library")
    done = alone("-c", "import rtsg")
    assert done.returncode == 1 and "ImportError" in done.stderr
    assert rtsg.native is True


def test_a_log_is_printed_by_the_package(alone):
    done = alone("-m", "rtsg", CONFORMANCE / "scene.rlog", "--values")
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0 and lines[0]["as_recorded"] and lines[-1]["frames"] == 1 and lines[-1]["values"], done.stderr


def test_a_reader_that_has_had_enough_ends_the_printing_quietly(alone):
    ours, theirs = os.pipe()
    os.close(ours)  # `| head` has gone
    try:
        done = subprocess.run([sys.executable, "-m", "rtsg", CONFORMANCE / "scene.rlog", "--values"], stdout=theirs, stderr=subprocess.PIPE, check=False,
                              env={"PYTHONPATH": str(alone.folder)})
    finally:
        os.close(theirs)
    assert done.stderr == b""
