#!/usr/bin/env python3
"""The second user attaches picture and sound to one scene: both show the same states, from one world."""
import contextlib
import sys

from harness import *

HALL = ROOT / "examples" / "demo" / "hall.x3dv"
SECONDS, FPS = 2 if LONG else 1, 5
SMALL = ["--size", "64x36", "--spp", "1", "--rays", "100", "--base", HALL.parent]


def record(user):
    user.run("record", HALL, "-o", "s.rlog", "--for", f"{SECONDS}s", "--fps", "30")


def both(user, *more):
    return user.run("replay", "s.rlog", "--json", "--for", f"{SECONDS}s", "--fps", FPS, "--render", "p%02d.png", "--listen", "s.wav", *SMALL, *more)


def same_world(user, report):
    equal(report["worlds"], 1, "worlds")
    equal(report["flattenings"], 1, "flattenings")
    equal(report["pictures"], SECONDS * FPS, "pictures")
    equal(len(report["picture_states"]), SECONDS * FPS, "states named")
    equal(report["picture_states"], report["sound_states"], "picture and sound of a frame are of one state")
    _, rate, samples = wav_samples(user.path("s.wav"))
    equal(samples, SECONDS * rate, "samples of sound")


def test_quiet(user):
    record(user)
    same_world(user, both(user))


def twice(user, load):
    """Pictures and sound are those of the states, not of the clock."""
    record(user)
    same_world(user, both(user))
    first = {n: user.path(n).read_bytes() for n in [*pictures(user.folder, r"p\d\d\.png"), "s.wav"]}
    with load:
        same_world(user, both(user))
    for name, content in first.items():
        check(user.path(name).read_bytes() == content, f"{name} differs the second time")


def test_twice_the_same(user):
    """The load is what else runs on this machine."""
    twice(user, contextlib.nullcontext())


@only_long
def test_twice_the_same_under_load(user):
    twice(user, user.load())


def test_alone_and_together_are_the_same(user):
    record(user)
    same_world(user, both(user))
    together = {n: user.path(n).read_bytes() for n in [*pictures(user.folder, r"p\d\d\.png"), "s.wav"]}
    user.run("replay", "s.rlog", "--for", f"{SECONDS}s", "--fps", FPS, "--render", "p%02d.png", *SMALL)
    user.run("replay", "s.rlog", "--for", f"{SECONDS}s", "--listen", "s.wav", *SMALL)
    for name, content in together.items():
        check(user.path(name).read_bytes() == content, f"{name} differs when made alone")


def test_a_scene_its_log_and_its_mirror_give_the_same(user):
    """Who drives the scene makes no difference: a file, a log, or another process."""
    record(user)
    options = ["--json", "--for", f"{SECONDS}s", "--fps", FPS, "--render", "p%02d.png", "--listen", "s.wav", *SMALL]
    files = lambda: {n: without_notes(user.path(n)) for n in [*pictures(user.folder, r"p\d\d\.png"), "s.wav"]}
    user.run("run", HALL, *options)
    run = files()
    user.run("record", HALL, "-o", "five.rlog", "--for", f"{SECONDS}s", "--fps", FPS)
    same_world(user, user.run("replay", "five.rlog", *options))
    replayed = files()
    server, endpoint = user.serve(HALL, "--at", "2000-01-01", "--fps", FPS, "--await", "1", "--linger", "120s", "--for", f"{SECONDS + 1}s")
    same_world(user, user.run("mirror", endpoint, *options, "--wait", "60s"))
    mirrored = files()
    server.wait()
    equal(len(run), SECONDS * FPS + 1, "files")
    for name, content in run.items():
        check(replayed[name] == content, f"{name} of the log differs")
        check(mirrored[name] == content, f"{name} of the mirror differs")


def test_live(user):
    report = user.run("run", HALL, "--json", "--live", "--for", f"{SECONDS}s", "--fps", 60, "--render", "p%02d.png", "--listen", "s.wav", *SMALL)
    equal((report["flattenings"], report["worlds"]), (1, 1), "flattenings and worlds")
    _, rate, samples = wav_samples(user.path("s.wav"))
    equal(samples, SECONDS * rate, "samples of sound")
    equal(report["pictures"] + report["live"]["pictures_skipped"], SECONDS * 60, "every instant is pictured or counted as skipped")


def test_live_pictures_keep_what_no_change_touches_and_show_every_edit(user):
    # A box turns in a corner before a wall, and goes in the end.
    user.path("corner.x3dv").write_text("""#X3D V4.0 utf8
PROFILE Immersive
Viewpoint { position 0 0 9 }
Transform { translation 3 0 0 children Shape { appearance Appearance { material Material { diffuseColor 1 .5 .2 } } geometry Box { } } }
DEF T Transform { translation -3 1 0 children DEF S Switch { whichChoice 0 children Shape { geometry Box { size .5 .5 .5 } } } }
DEF CLOCK TimeSensor { cycleInterval 4 loop TRUE }
DEF TURN OrientationInterpolator { key [0 1] keyValue [0 0 1 0, 0 0 1 3] }
ROUTE CLOCK.fraction_changed TO TURN.set_fraction
ROUTE TURN.value_changed TO T.rotation
""")
    scene = ("corner.x3dv", "--at", "2000-01-01", "--set", "S.whichChoice=-1@1.55", "--size", "160x120")
    report = user.run("run", *scene, "--json", "--live", "--for", "2s", "--fps", 10, "--render", "p%02d.png")
    check(report["kept"] > .2, f"most of it rests: {report}")
    user.run("render", *scene, "--frames", 20, "--fps", 10, "-o", "r%02d.png")
    for place, time_ in enumerate(report["picture_times"]):
        equal(without_notes(user.path(f"p{place:02d}.png")), without_notes(user.path(f"r{round(time_ * 10):02d}.png")), f"the picture of {time_} s")
    check(without_notes(user.path("r00.png")) != without_notes(user.path("r19.png")), "what is edited is seen")


def test_killed_in_a_picture(user):
    record(user)
    program = user.start("replay", "s.rlog", "--render", "p%02d.png", "--listen", "s.wav", "--fps", 30, "--size", "320x180", "--spp", "4",
                         "--base", HALL.parent)
    while not user.path("p01.png").exists():
        check(program.process.poll() is None, program.err)
        time.sleep(0.02)
    program.signal(signal.SIGKILL)
    program.wait()
    check(all(is_whole_png(user.path(n)) for n in pictures(user.folder, r"p\d\d\.png")), "half a picture is left")
    check(not user.path("s.wav").exists(), "half a sound is left")
    same_world(user, both(user))  # again, over what is there


def test_ctrl_c_in_a_picture(user):
    record(user)
    program = user.start("replay", "s.rlog", "--render", "p%02d.png", "--fps", 30, "--size", "320x180", "--spp", "4", "--base", HALL.parent)
    while not user.path("p00.png").exists():
        check(program.process.poll() is None, program.err)
        time.sleep(0.02)
    program.signal(signal.SIGINT)
    check(program.wait() in (1, 130), "status")
    names = pictures(user.folder, r"p\d\d\.png")
    check(names and all(is_whole_png(user.path(n)) for n in names), f"pictures: {names}")
    only(user.folder, "results")


def test_full_disk(user):
    record(user)
    with small_disk(user.path("disk"), 24) as disk:
        program = user.start("replay", "s.rlog", "--render", disk / "p%02d.png", "--size", "160x90", "--spp", "1", "--base", HALL.parent)
        program.done(status=1)
        names = pictures(disk, r".*")
        check(all(is_whole_png(disk / n) for n in names), f"half a picture is left: {names}")


def test_wrong_file(user):
    user.path("wrong.rlog").write_bytes(b"this is no log" * 100)
    program = user.start("replay", "wrong.rlog", "--render", "p.png", "--listen", "s.wav")
    program.done(status=1)
    check("wrong.rlog" in program.err, f"the file is named: {program.err!r}")
    check(not user.path("p.png").exists() and not user.path("s.wav").exists(), "nothing is written")


if __name__ == "__main__":
    sys.exit(run(sys.modules[__name__]))
