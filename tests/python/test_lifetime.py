"""What becomes of scenes at the end of the interpreter, in forks, on other threads, by Ctrl-C; and that nothing leaks."""
import gc
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import pytest

import rtsg
from conftest import MOVING, ROOT, SCRIPTED

LONG = os.environ.get("RTSG_LONG", "0") not in ("", "0")
HALL = str(ROOT / "examples/demo/hall.x3dv")


def run(program, timeout=60, **options):
    """A Python of its own; SCRIPTED, MOVING and HALL are known."""
    head = f"import rtsg\nSCRIPTED = {SCRIPTED!r}\nMOVING = {MOVING!r}\nHALL = {HALL!r}\n"
    return subprocess.run([sys.executable, "-c", head + textwrap.dedent(program)], capture_output=True, text=True, timeout=timeout,
                          check=False, **options)


def test_the_interpreter_ends_with_scenes_that_run_scripts(tmp_path):
    done = run(f"""
        scenes = [rtsg.loads(SCRIPTED) for _ in range(3)]
        circle = [scenes[0]]
        circle.append(circle)
        scenes[0].subscribe(lambda changes: circle)
        server, log = scenes[1].serve(), scenes[2].record({str(tmp_path / "a.rlog")!r})
        for k in range(10):
            for scene in scenes: scene.frame(k / 10)
        scenes[0].render(width=16, height=16)
        import sys
        sys.exit(7)
        """)
    assert done.returncode == 7, done.stderr
    assert "shut down" in done.stdout  # the Scripts were told
    assert rtsg.Log(tmp_path / "a.rlog").verify()["first_divergence"] is None  # and the log closed in order


def test_the_interpreter_ends_by_an_exception_with_a_follower_and_a_log_open(tmp_path):
    done = run(f"""
        scene = rtsg.loads(MOVING)
        server = scene.serve()
        follower = rtsg.follow(server.endpoint)
        recorder = scene.record({str(tmp_path / "a.rlog")!r})
        scene.frame(0)
        scene.frame(1)
        follower.poll(1)
        raise RuntimeError("mine")
        """)
    assert done.returncode == 1 and done.stderr.rstrip().endswith("RuntimeError: mine"), done.stderr


def test_the_interpreter_ends_while_another_thread_pictures():
    done = run("""
        import threading, time
        def pictures():
            scene = rtsg.load(HALL)
            while True: scene.render(width=640, height=360, samples=64, integrator="path")
        threading.Thread(target=pictures, daemon=True).start()
        time.sleep(.7)
        """)
    assert done.returncode == 0, done.stderr


def test_a_scene_that_a_thread_made_and_left_ends_with_the_interpreter():
    done = run("""
        import threading
        kept = []
        def work():
            kept.append(rtsg.loads(SCRIPTED))
            kept[0].frame(0)
            kept[0].frame(1)
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
        """)
    assert done.returncode == 0, done.stderr


def test_another_thread_may_print_it(moving):
    printed, box = [], moving["BOX"]
    thread = threading.Thread(target=lambda: printed.extend([repr(moving), repr(box)]))
    thread.start()
    thread.join()
    assert printed == ["<rtsg.Scene of another thread>", f"<rtsg.Node #{box.node_id} of another thread's scene>"]


def test_another_thread_is_refused(moving):
    errors = []

    def use():
        for call in (lambda: moving.frame(0), lambda: moving["BOX"], lambda: moving.now, lambda: moving.render(),
                     lambda: moving.close(), lambda: moving.subscribe(print)):
            try:
                call()
            except rtsg.WrongThread as error:
                errors.append(error.code)

    thread = threading.Thread(target=use)
    thread.start()
    thread.join()
    assert errors == ["wrong-thread"] * 6
    moving.frame(0)


def test_scenes_on_threads_of_their_own_run_side_by_side():
    hashes = []

    def work():
        scene = rtsg.load(HALL)
        for k in range(60):
            scene.frame(k / 60)
        scene.render(width=64, height=36)
        hashes.append(scene.hash)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(hashes) == 4 and len(set(hashes)) == 1


def test_no_lock_is_held_while_a_picture_is_made(hall):
    ticks, stop = [], threading.Event()

    def count():
        while not stop.is_set():
            ticks.append(time.perf_counter())
            time.sleep(.001)

    thread = threading.Thread(target=count)
    thread.start()
    begun = time.perf_counter()
    hall.render(width=320, height=180, samples=16, integrator="path")
    ended = time.perf_counter()
    stop.set()
    thread.join()
    during = [tick for tick in ticks if begun < tick < ended]
    assert len(during) > 3  # of a thread that wants to run every millisecond or so


@pytest.mark.parametrize("work", [
    "rtsg.load(HALL).render(width=3840, height=2160, samples=64, integrator='path')",
    "rtsg.load(HALL).listen(3600)",
    "rtsg.load(HALL).irradiance((0, 1, 0), (0, 1, 0), error=1e-5)",
    "list(rtsg.follow('tcp://127.0.0.1:1'))",
    "rtsg.serve(rtsg.load(HALL))",
    "s = rtsg.loads(MOVING); s.serve().wait(3600)",
])
def test_ctrl_c_ends_work_that_takes_long(work):
    process = subprocess.Popen([sys.executable, "-c", f"import rtsg\nHALL, MOVING = {HALL!r}, {MOVING!r}\nprint('go', flush=True)\n{work}"],
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "go\n"
    time.sleep(1)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == -signal.SIGINT or process.returncode == 130, errors
    assert errors.rstrip().endswith("KeyboardInterrupt"), errors


def test_a_forked_process_makes_its_own_scenes_and_not_those_from_before(moving):
    server = moving.serve()
    moving.frame(0)
    moving.render(width=16, height=16)
    child = os.fork()
    if child == 0:
        status = 1
        try:
            try:
                moving.frame(1)
            except rtsg.Closed:
                own = rtsg.loads(MOVING)
                own.frame(0)
                own.frame(1)
                status = 0 if own["BOX"].translation[0] == 2 else 2
        finally:
            os._exit(status)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    moving.frame(1)
    server.close()


def test_a_scene_is_not_closed_by_what_it_calls(moving, tmp_path):
    with pytest.raises(rtsg.Error, match="not closed from within"):
        moving.subscribe(lambda changes: moving.close())
    subscription = moving.subscribe(lambda changes: None if changes.is_snapshot else moving.close())
    with pytest.raises(rtsg.Error) as raised:
        moving.frame(0)
    assert raised.value.code == "from-within" and not subscription.active
    moving.frame(1)  # it goes on
    recorders = []

    def ends(changes):  # a log may end there
        if changes.time == 3:
            recorders[0].close()
            with pytest.raises(rtsg.Error, match="server is not closed"):
                server.close()

    with moving.serve() as server:
        recorders.append(moving.record(tmp_path / "a.rlog"))
        moving.subscribe(ends)
        moving.frame(2)
        moving.frame(3)
        moving.frame(4)
    moving.close()
    assert rtsg.Log(tmp_path / "a.rlog").verify()["first_divergence"] is None


def test_a_log_and_a_follower_are_not_closed_by_what_they_call(moving, tmp_path):
    with moving.serve() as server, rtsg.follow(server.endpoint) as follower, moving.record(tmp_path / "a.rlog"):
        moving.frame(0)
        while not follower.poll(.1):
            moving.frame(moving.now)
        follower.scene.subscribe(lambda changes: None if changes.is_snapshot else follower.close())
        moving.frame(1)
        with pytest.raises(rtsg.Error, match="connection is not closed"):
            while follower.poll(1):
                pass
    log = rtsg.Log(tmp_path / "a.rlog")
    for refused in (log.close, log.step, lambda: log.seek(0), log.scene.close):
        log.scene.subscribe(lambda changes: None if changes.is_snapshot else refused())
        with pytest.raises(rtsg.Error) as raised:
            log.seek(0)
            while log.step():
                pass
        assert raised.value.code == "from-within"
    log.close()


class Closes:
    """What an array may be made of, and closes a scene, or raises, when it is."""

    def __init__(self, act):
        self.act = act

    def __array__(self, *_, **__):
        self.act()

    def __len__(self):
        return 3

    def __iter__(self):
        self.act()

    __getitem__ = __float__ = __array__


def test_a_scene_is_not_closed_by_what_it_reads_values_from():
    scene = rtsg.Scene()
    box = scene.create("Transform")
    for use in (lambda value: setattr(box, "translation", value), lambda value: box.send_event("translation", value),
                lambda value: scene.send(f"#{box.node_id}.translation", value), lambda value: scene.create("Coordinate", point=value),
                lambda value: scene.set_each([box], "translation", value), lambda value: scene.define("Own", {"a": ("SFVec3f", "inputOutput", value)})):
        with pytest.raises((rtsg.Error, TypeError)):
            use(Closes(scene.close))
        assert not scene.closed
        with pytest.raises(KeyboardInterrupt):  # Ctrl-C is no wrong value
            use(Closes(lambda: (_ for _ in ()).throw(KeyboardInterrupt)))

    def closing():
        scene.close()
        yield box

    with pytest.raises(rtsg.Error):
        scene.set_each(closing(), "translation", [[0, 0, 0]])


def test_no_object_is_pickled_or_made_of_nothing(tmp_path):
    done = run("""
        import copy, pickle
        scene = rtsg.loads(MOVING)
        for thing in (scene, scene["BOX"], scene.frame(0), scene.snapshot()[0], scene.subscribe(lambda c: None)):
            for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
                try:
                    pickle.dumps(thing, protocol)
                    raise SystemExit("pickled")
                except TypeError as error:
                    assert "cannot pickle" in str(error)
            for read in (repr, lambda one: one == one and one.closed, lambda one: len(one), lambda one: one.BOX):
                try:
                    read(type(thing).__new__(type(thing)))
                except (TypeError, AttributeError, rtsg.Error):
                    pass
        print("done")
    """)
    assert (done.returncode, done.stdout) == (0, "done\n"), done.stderr


def test_nodes_arrays_and_sets_outlive_their_scene():
    scene = rtsg.loads(MOVING)
    scene.frame(0)
    box, way, changes = scene["BOX"], scene["WAY"].keyValue, scene.frame(1)
    del scene
    gc.collect()
    assert way.tolist() == [[0, 0, 0], [4, 0, 0]]
    assert changes["BOX.translation"].tolist() == [2, 0, 0]  # what holds the scene keeps it
    assert box.translation.tolist() == [2, 0, 0]


def resident():
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def grows(work, times):
    """Bytes by which the process grows in the second half of so many calls, once the first has made its caches."""
    for _ in range(times // 2):
        work()
    gc.collect()
    before = resident()
    for _ in range(times - times // 2):
        work()
    gc.collect()
    return resident() - before


def test_a_thousand_scenes_with_pictures_leak_nothing():
    living = rtsg._rtsg._living()

    def work():
        scene = rtsg.loads(MOVING)
        box = scene["BOX"]
        # A circle that only the garbage collector sees.
        scene.subscribe(lambda changes: (scene, box))
        scene.frame(0)
        scene.frame(1)
        scene.render(width=16, height=16, samples=1)

    times = 10_000 if LONG else 1_000
    assert grows(work, times) < 8e6
    assert rtsg._rtsg._living() <= living + 2


def test_scripts_followers_and_errors_leak_nothing(tmp_path):
    living = rtsg._rtsg._living()

    def fails(_):
        raise ValueError

    def work():
        scene = rtsg.loads(SCRIPTED)
        with scene.serve() as server, rtsg.follow(server.endpoint) as follower, scene.record(tmp_path / "a.rlog"):
            scene.frame(0)
            follower.poll(0)
        for call in (lambda: scene.subscribe(fails), lambda: scene["NOBODY"], lambda: scene.frame(-1)):
            with pytest.raises((ValueError, KeyError, rtsg.Error)):
                call()

    assert grows(work, 10_000 if LONG else 60) < 8e6
    gc.collect()
    assert rtsg._rtsg._living() <= living + 4


def test_subscriptions_that_were_closed_leak_nothing(moving):
    assert grows(lambda: moving.subscribe(lambda changes: None).close(), 20_000) < 2e6


def test_fields_leak_nothing(moving):
    moving.subscribe(lambda changes: [change.value for change in changes])
    points = moving.create("Coordinate", point=[[0, 0, 0]] * 1000)

    def work():
        points.point = points.point * 1.5 % 7
        moving["VIEW"].description = "text"
        moving.frame(moving.now + .01)
        moving.snapshot()

    assert grows(work, 4_000) < 8e6


def test_dir_of_a_node_that_is_gone_raises_nothing(moving):
    box, view = moving["BOX"], moving["VIEW"]
    assert "translation" in dir(box)
    moving.remove(box)
    assert "translation" not in dir(box) and "is_alive" in dir(box)
    moving.close()
    assert "is_alive" in dir(view)
