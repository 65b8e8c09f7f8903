#!/usr/bin/env python3
"""The third user keeps a recorded session as a test while the scene is edited, harmlessly and harmfully."""
import sys

from harness import *

DOOR = ROOT / "examples" / "door.x3dv"


def record(user):
    user.path("door.x3dv").write_text(DOOR.read_text())
    user.run("record", "door.x3dv", "-o", "door.rlog", "--for", "2s", "--fps", "30", "--set", "PRESSED.set_boolean=TRUE@0.5")


def rerun(user, status=0):
    program = user.start("replay", "door.rlog", "--verify", "--rerun", "door.x3dv")
    program.done(status)
    return program


def test_unchanged_passes(user):
    record(user)
    rerun(user)


@only_long
def test_unchanged_passes_under_load(user):
    record(user)
    with user.load():
        rerun(user)


def test_comments_and_spaces_are_no_change(user):
    record(user)
    text = user.path("door.x3dv").read_text()
    lines = text.splitlines()
    user.path("door.x3dv").write_text("\n".join([lines[0], "# a remark", *[line + "   # another" if line.strip() and "#" not in line and
                                                                         '"' not in line else line for line in lines[1:]]]) + "\n")
    rerun(user)


def test_another_swing_fails_and_is_named(user):
    record(user)
    text = user.path("door.x3dv").read_text()
    changed = text.replace("0 -1 0 1.4", "0 -1 0 1.2")
    check(changed != text, "the scene is another than this test knows")
    user.path("door.x3dv").write_text(changed)
    program = rerun(user, status=1)
    check("SWING.keyValue" in program.err + program.out, f"field named: {program.out} {program.err}")


def test_an_added_node_fails_and_says_why(user):
    record(user)
    with open(user.path("door.x3dv"), "a") as scene:
        scene.write('\nWorldInfo { title "edited" }\n')
    program = rerun(user, status=1)
    check("frame 2" in program.err and "#1.children: recorded [" in program.err and ", now [" in program.err,
          f"frame, node, field and both values are named: {program.err!r}")


def test_another_colour_is_named_and_can_be_seen(user):
    """The state differs, and so does the picture that was expected."""
    record(user)
    picture = ["--expect-picture", "door.png", "--size", "64x48"]
    user.run("replay", "door.rlog", "--rerun", "door.x3dv", "--update", *picture)
    user.run("replay", "door.rlog", "--rerun", "door.x3dv", *picture)
    text = user.path("door.x3dv").read_text()
    user.path("door.x3dv").write_text(text.replace("diffuseColor 0.75 0.72 0.65", "diffuseColor 0.1 0.2 0.65"))
    program = user.start("replay", "door.rlog", "--rerun", "door.x3dv", *picture)
    program.done(status=1)
    check("diffuseColor: recorded 0.75 0.72 0.65, now 0.1 0.2 0.65" in program.err, f"field and values are named: {program.err!r}")
    user.run("record", "door.x3dv", "-o", "new.rlog", "--for", "2s", "--fps", "30", "--set", "PRESSED.set_boolean=TRUE@0.5")
    other = user.start("replay", "new.rlog", *picture)
    other.done(status=1)
    check("door.png" in other.err, f"the picture is named: {other.err!r}")


def test_a_name_that_nothing_uses_is_a_change_and_is_named(user):
    record(user)
    text = user.path("door.x3dv").read_text()
    user.path("door.x3dv").write_text(text.replace("Viewpoint {", "DEF EYE Viewpoint {"))
    program = rerun(user, status=1)
    check("name" in program.err and "EYE" in program.err, f"{program.err!r}")


def test_ctrl_c_while_recording(user):
    user.path("door.x3dv").write_text(DOOR.read_text())
    program = user.start("record", "door.x3dv", "-o", "cut.rlog", "--for", "60min", "--realtime")
    while not user.path("cut.rlog").exists() or user.path("cut.rlog").stat().st_size < 3000:
        check(program.process.poll() is None, program.err)
        time.sleep(0.05)
    program.signal(signal.SIGINT)
    program.wait()
    user.run("replay", "cut.rlog", "--verify")
    rerun_of_what_is_there = user.start("replay", "cut.rlog", "--rerun", "door.x3dv")
    rerun_of_what_is_there.done()


def test_full_disk_while_recording(user):
    user.path("door.x3dv").write_text(DOOR.read_text())
    with small_disk(user.path("disk"), 24) as disk:
        program = user.start("record", "door.x3dv", "-o", disk / "x.rlog", "--for", "60s", "--set", "PRESSED.set_boolean=TRUE@0.5")
        program.done(status=1)
        check("space" in program.err and "x.rlog" in program.err, f"the reason and the file are named: {program.err!r}")
        user.run("replay", disk / "x.rlog")
        user.run("replay", disk / "x.rlog", "--rerun", "door.x3dv")


def test_a_wrong_file_is_no_log(user):
    record(user)
    program = user.start("replay", "door.x3dv", "--rerun", "door.x3dv")
    program.done(status=1)
    check("door.x3dv" in program.err, f"the file is named: {program.err!r}")
    program = user.start("replay", "door.rlog", "--rerun", "none.x3dv")
    program.done(status=1)
    check("none.x3dv" in program.err, f"the file is named: {program.err!r}")


def test_a_broken_scene_is_an_error_with_its_place(user):
    record(user)
    with open(user.path("door.x3dv"), "a") as scene:
        scene.write("\nTransform { translation 1 2 \n")
    program = rerun(user, status=1)
    check("door.x3dv:" in program.err, f"file and line are named: {program.err!r}")


def test_a_damaged_log_is_named(user):
    record(user)
    data = bytearray(user.path("door.rlog").read_bytes())
    data[len(data) // 2] ^= 1
    user.path("door.rlog").write_bytes(data)
    program = user.start("replay", "door.rlog", "--verify", "--json")
    program.done(status=1)
    check("damaged" in program.err or "damage" in program.out, f"{program.err!r} {program.out!r}")


def test_a_killed_recording_replays(user):
    user.path("door.x3dv").write_text(DOOR.read_text())
    server, _ = user.serve("door.x3dv", "--for", "60s", "--record", "cut.rlog")
    while not user.path("cut.rlog").exists() or user.path("cut.rlog").stat().st_size < 3000:
        check(server.process.poll() is None, server.err)
        time.sleep(0.05)
    server.signal(signal.SIGKILL)
    server.wait()
    program = user.start("replay", "cut.rlog", "--json")
    program.wait()
    check('"frames":' in program.out and '"first_divergence":null' in program.out, f"{program.out!r} {program.err!r}")


def test_recording_does_not_replace_a_log(user):
    record(user)
    before = user.path("door.rlog").read_bytes()
    program = user.start("record", "door.x3dv", "-o", "door.rlog", "--for", "1s")
    check(program.wait() != 0, "an existing log was replaced without --force")
    check(user.path("door.rlog").read_bytes() == before, "the log was touched")
    user.run("record", "door.x3dv", "-o", "door.rlog", "--for", "1s", "--force")


if __name__ == "__main__":
    sys.exit(run(sys.modules[__name__]))
