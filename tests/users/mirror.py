#!/usr/bin/env python3
"""The first user mirrors a live scene to another process, with pictures, sound and a log: quiet, under load, and harmed."""
import contextlib
import sys

from harness import *

HALL = ROOT / "examples" / "demo" / "hall.x3dv"
SECONDS, FPS = 2 if LONG else 1, 5
COMMON = ["--spp", "1", "--rays", "100", "--base", HALL.parent]


def mirror_with_everything(user, endpoint, size="64x36"):
    return user.start("mirror", endpoint, "--json", "--for", f"{SECONDS}s", "--fps", FPS, "--render", "p%02d.png", "--listen", "m.wav", "--record",
                      "m.rlog", "--save", "m.x3dv", "--wait", "60s", "--size", size, *COMMON)


def whole(user, report):
    """Everything that was asked for is there."""
    equal(report["equal"], True, "equal")
    equal(report["hash"], report["origin_hash"], "hash")
    equal(report["pictures"], SECONDS * FPS, "pictures counted")
    names = pictures(user.folder, r"p\d\d\.png")
    equal(names, [f"p{k:02d}.png" for k in range(SECONDS * FPS)], "pictures")
    check(all(is_whole_png(user.path(n)) for n in names), "a picture is cut short")
    _, rate, samples = wav_samples(user.path("m.wav"))
    equal(samples, SECONDS * rate, "samples of sound")
    equal(report["gaps"], 0, "gaps")
    equal(len(report["picture_states"]), SECONDS * FPS, "states named")
    equal(report["picture_states"], report["sound_states"], "picture and sound of a frame are of one state")
    equal((report["flattenings"], report["worlds"]), (1, 1), "flattenings and worlds")
    only(user.folder, "results")


def follow(user):
    server, endpoint = user.serve(HALL, "--record", "s.rlog", "--linger", "120s", "--for", f"{SECONDS + 2}s")
    report = mirror_with_everything(user, endpoint).done()
    whole(user, report)
    server.done()
    user.run("replay", "s.rlog", "--verify")
    user.run("replay", "m.rlog", "--verify")
    # The mirror left first: that is the one difference between the two logs.
    difference = user.start("replay", "s.rlog", "--diff", "m.rlog")
    difference.done(status=1)
    check("m.rlog ends before s.rlog does" in difference.err, f"the logs agree as far as both go: {difference.err!r}")


def test_quiet(user):
    follow(user)


@only_long
def test_under_load(user):
    with user.load():
        follow(user)


def test_large_pictures_are_late_and_complete(user):
    """What takes longer than the session is made all the same, and the delay is told."""
    server, endpoint = user.serve(HALL, "--linger", "1s", "--for", f"{SECONDS + 2}s")
    report = mirror_with_everything(user, endpoint, "1280x720").done()
    whole(user, report)
    check(report["behind_s"] > 0, "how far it was behind is told")
    check(report["overlapped"] > SECONDS * FPS, "frames were followed while pictures were in the making")
    server.done()


def test_server_is_killed(user):
    server, endpoint = user.serve(HALL, "--for", "60s")
    mirror = user.start("mirror", endpoint, "--json", "--for", "20s", "--fps", FPS, "--render", "p%02d.png", "--listen", "m.wav", "--record",
                        "m.rlog", "--wait", "3s", "--size", "64x36", *COMMON)
    while not user.path("p01.png").exists():
        check(mirror.process.poll() is None, mirror.err)
        time.sleep(0.05)
    server.signal(signal.SIGKILL)
    report = mirror.done(status=1)
    check(report["pictures"] < 20 * FPS, "some pictures are missing")
    check(report["missing"], "what is missing is named")
    equal(pictures(user.folder, r"p\d\d\.png"), [f"p{k:02d}.png" for k in range(report["pictures"])], "pictures")
    wav_samples(user.path("m.wav"))
    user.run("replay", "m.rlog", "--verify")
    only(user.folder, "results")


def test_ctrl_c_leaves_whole_files(user):
    server, endpoint = user.serve(HALL, "--for", "60s")
    mirror = user.start("mirror", endpoint, "--json", "--fps", FPS, "--render", "p%02d.png", "--listen", "m.wav", "--record", "m.rlog", "--wait",
                        "60s", "--size", "64x36", *COMMON)
    while not user.path("p02.png").exists():
        check(mirror.process.poll() is None, mirror.err)
        time.sleep(0.05)
    mirror.signal(signal.SIGINT)
    status = mirror.wait()
    check(status in (0, 1, 130), f"status {status}: {mirror.err}")
    names = pictures(user.folder, r"p\d\d\.png")
    check(len(names) >= 3 and all(is_whole_png(user.path(n)) for n in names), f"pictures: {names}")
    wav_samples(user.path("m.wav"))
    user.run("replay", "m.rlog", "--verify")
    only(user.folder, "results")
    server.signal(signal.SIGTERM)
    server.wait()


def test_full_disk(user):
    server, endpoint = user.serve(HALL, "--for", "60s")
    with small_disk(user.path("disk"), 64) as disk:
        mirror = user.start("mirror", endpoint, "--json", "--for", "4s", "--fps", FPS, "--render", disk / "p%02d.png", "--size", "160x90", "--spp",
                            "1", "--base", HALL.parent, "--wait", "60s")
        mirror.done(status=1)
        check("disk" in mirror.err or "space" in mirror.err, f"the reason is said: {mirror.err!r}")
        names = pictures(disk, r".*")
        check(names and all(is_whole_png(disk / n) for n in names), f"half a picture is left: {names}")
    server.signal(signal.SIGTERM)
    server.wait()


def live(user):
    """Newest states, merged: the session is followed to its end, all of the sound is there, each picture is whole."""
    server, endpoint = user.serve(HALL, "--linger", "120s", "--for", f"{SECONDS + 2}s", "--await", "1")
    report = user.start("mirror", endpoint, "--json", "--live", "--for", f"{SECONDS}s", "--fps", 30, "--render", "p%02d.png", "--listen", "m.wav",
                        "--wait", "60s", "--size", "320x180", *COMMON).done()
    equal(report["equal"], True, "equal")
    _, rate, samples = wav_samples(user.path("m.wav"))
    equal(samples, SECONDS * rate, "samples of sound")
    names = pictures(user.folder, r"p\d\d\.png")
    equal(len(names), report["pictures"], "pictures counted")
    check(names and all(is_whole_png(user.path(n)) for n in names), f"pictures: {names}")
    states = report["picture_states"]
    check(all(a < b for a, b in zip(states, states[1:])), f"each picture is of a later state: {states}")
    equal(report["live"]["states_pictured"], len(states), "states pictured")
    equal(len(states) + report["live"]["pictures_skipped"], SECONDS * 30, "every instant is pictured or counted as skipped")
    check(report["live"]["states_heard"] <= report["live"]["states"], "states heard")
    server.done()


def test_live(user):
    live(user)


@only_long
def test_live_under_load(user):
    with user.load():
        live(user)


def test_mirror_is_killed(user):
    """The server goes on, the next mirror is as good as the first, and what was logged can be replayed."""
    server, endpoint = user.serve(HALL, "--for", "60s")
    mirror = user.start("mirror", endpoint, "--fps", FPS, "--render", "k%02d.png", "--record", "k.rlog", "--wait", "60s", "--size", "64x36", *COMMON)
    while not user.path("k02.png").exists():
        check(mirror.process.poll() is None, mirror.err)
        time.sleep(0.05)
    mirror.signal(signal.SIGKILL)
    mirror.wait()
    # What it was writing in that very moment is still under its hidden name: nobody was left to remove it.
    unfinished = [p for p in user.folder.iterdir() if p.name.startswith(".rtsg-")]
    check(len(unfinished) <= 2, f"more than one picture and one log under way: {unfinished}")
    for path in unfinished:
        path.unlink()
    check(all(is_whole_png(user.path(n)) for n in pictures(user.folder, r"k\d\d\.png")), "a picture is cut short")
    user.run("replay", "k.rlog")
    cut = user.start("replay", "k.rlog", "--verify")
    cut.done(status=1)
    check("not closed" in cut.err, f"that it was cut is said: {cut.err!r}")
    whole(user, mirror_with_everything(user, endpoint).done())
    server.signal(signal.SIGTERM)
    server.wait()


@contextlib.contextmanager
def on_a_small_disk(user, kilobytes):
    """A session goes on whose log has no room; what becomes of the log is the caller's."""
    with small_disk(user.path("disk"), kilobytes) as disk:
        server, endpoint = user.serve(HALL, "--record", disk / "s.rlog", "--linger", "120s", "--for", f"{SECONDS + 2}s")
        whole(user, mirror_with_everything(user, endpoint).done())
        server.wait()
        check("space" in server.err, f"that its log ended is said: {server.err!r}")
        yield server, disk / "s.rlog"


def test_server_with_a_full_disk_goes_on(user):
    with on_a_small_disk(user, 64) as (server, log):  # the first state takes 46
        check("holds the session at least to state" in server.err, f"what the log holds is said: {server.err!r}")
        user.run("replay", log)


def test_server_without_room_for_a_state_goes_on(user):
    with on_a_small_disk(user, 32) as (server, log):
        check("nothing was recorded" in server.err, f"that there is no log is said: {server.err!r}")
        check(not any(log.parent.iterdir()), "a log without a state is left")


def test_a_full_disk_keeps_the_log_that_was_there(user):
    with small_disk(user.path("disk"), 8) as disk:
        user.run("record", HALL.parent.parent / "door.x3dv", "-o", "door.rlog", "--for", "20ms")
        old = user.path("door.rlog").read_bytes()[:4096]  # a page of this disk; the other one is full as well
        (disk / "old.rlog").write_bytes(old)
        (disk / "other").write_bytes(bytes(4096))
        for more, name in ((["--force"], "old.rlog"), ([], "new.rlog")):
            recorded = user.start("record", HALL, "-o", disk / name, "--for", "1s", *more)
            recorded.done(status=1)
            check("No space left" in recorded.err, f"the reason is said: {recorded.err!r}")
        check((disk / "old.rlog").read_bytes() == old, "the log that was there is as it was")
        equal(sorted(p.name for p in disk.iterdir()), ["old.rlog", "other"], "files")


def test_wrong_files(user):
    server, endpoint = user.serve(HALL, "--for", "60s")
    user.path("old.rlog").write_bytes(b"a log of last week")
    user.path("key").write_bytes(b"this is no key")
    for wrong, named in ((["--record", "old.rlog"], "old.rlog"), (["--key", "key"], "key"), (["--render", "no/such/folder/p%d.png"], "no/such"),
                         (["--render", "p.txt"], "p.txt"), (["--save", "s.doc"], "s.doc")):
        mirror = user.start("mirror", endpoint, "--for", "1s", "--wait", "10s", "--size", "8x8", *wrong)
        check(mirror.wait() in (1, 2), f"{wrong} is accepted")
        check(named in mirror.err, f"{wrong}: what is wrong is named: {mirror.err!r}")
    equal(user.path("old.rlog").read_bytes(), b"a log of last week", "the file that was there")
    whole(user, mirror_with_everything(user, endpoint).done())  # the server minds nothing of it
    server.signal(signal.SIGTERM)
    server.wait()


if __name__ == "__main__":
    sys.exit(run(sys.modules[__name__]))
