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
    check("frame" in program.err, f"the frame is named: {program.err!r}")


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
