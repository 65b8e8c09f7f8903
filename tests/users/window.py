#!/usr/bin/env python3
"""Somebody in front of a window: looks, walks, clicks at a scene that is served elsewhere, and goes through a recorded session. The
display is Xvfb's, the hand is xdotool's; where these are not installed the tests are skipped."""
import contextlib
import os
import pathlib
import re
import shutil
import struct
import subprocess
import sys
import tempfile

from harness import *

TOUCH = """#X3D V4.0 utf8
PROFILE Immersive
Viewpoint { position 0 0 6 }
Viewpoint { position 0 0 60 }
DEF T Transform { children [
  DEF TS TouchSensor { }
  Shape { appearance Appearance { material UnlitMaterial { emissiveColor 1 0 0 } } geometry Box { size 3 3 3 } } ] }
DEF SPIN TimeSensor { cycleInterval 2 startTime -100 }
DEF OI OrientationInterpolator { key [0 1] keyValue [0 0 1 0, 0 0 1 1.5] }
ROUTE TS.touchTime TO SPIN.startTime
ROUTE SPIN.fraction_changed TO OI.set_fraction
ROUTE OI.value_changed TO T.rotation
"""


@contextlib.contextmanager
def display():
    """An X server of its own, whose number is free. It does not begin anew when its last client goes: who came meanwhile was refused."""
    for tool in ("Xvfb", "xdotool"):
        if not shutil.which(tool):
            raise Skipped(f"{tool} is not installed")
    reader, writer = os.pipe()
    frames = tempfile.mkdtemp(prefix="rtsg-screen-")
    server = subprocess.Popen(["Xvfb", "-noreset", "-displayfd", str(writer), "-screen", "0", "800x600x24", "-nolisten", "tcp", "-fbdir", frames],
                              pass_fds=[writer], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(writer)
    try:
        with os.fdopen(reader) as number:
            name = ":" + number.readline().strip()
        check(name != ":", "Xvfb did not start")
        before = {key: os.environ.get(key) for key in ("DISPLAY", "SDL_VIDEODRIVER", "RTSG_TEST_FRAMES")}
        os.environ.update(DISPLAY=name, SDL_VIDEODRIVER="x11", RTSG_TEST_FRAMES=frames)
        yield
        for key, value in before.items():
            os.environ.pop(key) if value is None else os.environ.__setitem__(key, value)
    finally:
        server.terminate()  # not killed: its lock would stay, and two that clear it away take the same number
        server.wait()
        shutil.rmtree(frames, ignore_errors=True)


def hand(*words):
    subprocess.run(["xdotool", *map(str, words)], check=True, stdout=subprocess.DEVNULL)


def window_of(viewer):
    """Waits until it is there, with a picture in it, and in front. SDL may replace a window that it has just opened: then the next one counts."""
    windows = lambda: subprocess.run(["xdotool", "search", "--onlyvisible", "--name", "rtsg"], capture_output=True, text=True).stdout.split()
    end = time.monotonic() + 60
    while time.monotonic() < end:
        check(viewer.process.poll() is None, f"the window went away: {viewer.err!r}")
        found = windows()[:1]
        if found and subprocess.run(["xdotool", "windowmove", *found, "0", "0", "windowfocus", *found], capture_output=True).returncode == 0:
            time.sleep(1)
            if found == windows()[:1]:
                return found[0]
        time.sleep(0.05)
    raise AssertionError("no window opened")


def view(user, what, *more):
    return user.start("view", what, "--mute", "--json", "--size", "400x300", *(() if "--bar" in more else ("--no-bar",)),
                      *(word for word in more if word != "--bar"))


def test_a_click_in_a_window_turns_what_is_served_elsewhere(user):
    user.path("touch.x3dv").write_text(TOUCH)
    with display():
        server, endpoint = user.serve("touch.x3dv", "--upstream", "events", "--record", "touch.rlog", "--fps", "30")
        viewer = view(user, endpoint, "--name", "Ann")
        window_of(viewer)
        hand("mousemove", 200, 150)
        time.sleep(0.5)
        hand("mousedown", 1)
        time.sleep(0.3)
        hand("mouseup", 1)
        time.sleep(1.5)
        hand("key", "Escape")
        equal(viewer.done()["whole"], True, "at rest the picture is whole")
        server.signal(signal.SIGINT)
        server.wait()
    program = user.start("replay", "touch.rlog", "--blame", "T.rotation")
    program.done()
    check("Ann (from a pointer" in program.out, f"the log has who clicked: {program.out!r}")


def test_keys_walk_and_viewpoints_change_what_is_seen(user):
    user.path("touch.x3dv").write_text(TOUCH)
    with display():
        viewer = view(user, "touch.x3dv", "--screenshot", "far.png")
        window_of(viewer)
        hand("key", "Next")  # PGDN: the viewpoint far away
        time.sleep(2)
        hand("key", "Escape")
        check(viewer.done()["events"] >= 2, "a key and its release")
    user.path("moved.x3dv").write_text(TOUCH.replace("Viewpoint { position 0 0 6 }\n", ""))
    user.run("render", "moved.x3dv", "-o", "same.png", "--size", "400x300")
    equal(user.path("far.png").read_bytes(), user.path("same.png").read_bytes(), "the picture from that viewpoint")


def test_a_session_is_gone_through(user):
    user.path("touch.x3dv").write_text(TOUCH)
    user.run("record", "touch.x3dv", "-o", "long.rlog", "--for", "60s", "--fps", "10", "--set", "TS.enabled=FALSE@30")
    with display():
        viewer = view(user, "long.rlog")
        window_of(viewer)
        for _ in range(4):
            hand("key", "ctrl+Right")
            time.sleep(0.3)
        hand("key", "ctrl+space")
        time.sleep(0.3)
        hand("key", "Escape")
        sequence = viewer.done()["sequence"]
    check(200 <= sequence <= 300, f"20 s on, and what was played: state {sequence}")


def picture_of_screen():
    """Width, and the red, green and blue bytes of what is on the display now: Xvfb keeps it in a file, as xwd writes them."""
    dump = (pathlib.Path(os.environ["RTSG_TEST_FRAMES"]) / "Xvfb_screen0").read_bytes()
    head = struct.unpack_from(">25I", dump)
    size, width, height, row, colours = head[0], head[4], head[5], head[12], head[19]
    begin = size + 12 * colours
    pixels = bytearray(3 * width * height)
    for y in range(height):
        line = dump[begin + y * row:begin + y * row + 4 * width]
        for channel in range(3):
            pixels[3 * y * width + channel:3 * (y + 1) * width:3] = line[2 - channel::4]
    return width, bytes(pixels)


def is_shown(viewer):
    end = time.monotonic() + 20
    while time.monotonic() < end:
        width, pixels = picture_of_screen()
        # The corner of the first panel lies over what is black there.
        if max(pixels[3 * (30 * width + 14):][:3]) > 8:
            return True
        if "no overlay" in viewer.err:
            raise Skipped("built without overlay")
        time.sleep(0.2)
    return False


def test_f1_shows_what_is_under_the_hand_and_its_panels_keep_their_clicks(user):
    user.path("touch.x3dv").write_text(TOUCH)
    with display():
        viewer = view(user, "touch.x3dv", "--screenshot", "end.png")
        found = window_of(viewer)
        title = lambda: subprocess.run(["xdotool", "getwindowname", found], capture_output=True, text=True).stdout
        check("F1 shows more" in title(), f"the title says so: {title()!r}")
        hand("key", "F1")
        check(is_shown(viewer), "there is a panel")
        check(is_seen(lambda: "F1" not in title()), f"once is enough: {title()!r}")
        # The second viewpoint's line is somewhere below the figures: the box is small then.
        for y in range(120, 296, 6):
            hand("mousemove", 60, y, "click", 1)
            time.sleep(0.05)
        hand("key", "F1")
        time.sleep(2)
        hand("key", "Escape")
        viewer.done()
    user.path("moved.x3dv").write_text(TOUCH.replace("Viewpoint { position 0 0 6 }\n", ""))
    user.run("render", "moved.x3dv", "-o", "same.png", "--size", "400x300")
    equal(user.path("end.png").read_bytes(), user.path("same.png").read_bytes(), "the picture from that viewpoint")


def test_a_time_line_is_clicked_and_a_state_stepped(user):
    user.path("touch.x3dv").write_text(TOUCH)
    user.run("record", "touch.x3dv", "-o", "long.rlog", "--for", "60s", "--fps", "10")
    with display():
        viewer = view(user, "long.rlog")
        window_of(viewer)
        hand("key", "F1")
        check(is_shown(viewer), "there is a panel")
        hand("key", "ctrl+space")
        hand("mousemove", 200, 270, "click", 1)  # the middle of the time line
        time.sleep(0.5)
        hand("key", "Escape")
        sequence = viewer.done()["sequence"]
    check(290 <= sequence <= 312, f"30 s of 60: state {sequence}")


def colours_in(rows, columns):
    width, pixels = picture_of_screen()
    return {tuple(pixels[3 * (y * width + x):][:3]) for y in rows for x in columns}


def test_marks_of_a_time_line_are_where_something_came_and_where_bytes_are_damaged(user):
    user.path("touch.x3dv").write_text(TOUCH)
    user.run("record", "touch.x3dv", "-o", "marks.rlog", "--for", "60s", "--fps", "10", "--set", "TS.enabled=FALSE@30")
    whole = user.path("marks.rlog").read_bytes()
    user.path("damaged.rlog").write_bytes(whole[:len(whole) // 2] + bytes(64) + whole[len(whole) // 2 + 64:])
    yellow, red = (255, 204, 92), (255, 122, 92)
    with display():
        for name, colour, columns in (("marks.rlog", yellow, range(198, 203)), ("damaged.rlog", red, range(30, 380))):
            viewer = view(user, name)
            window_of(viewer)
            hand("key", "F1")
            check(is_shown(viewer), "there is a panel")
            end = time.monotonic() + 20
            while colour not in colours_in(range(255, 285), columns) and time.monotonic() < end:
                time.sleep(0.2)
            check(colour in colours_in(range(255, 285), columns), f"a mark in {name}")
            check(colour != red or red not in colours_in(range(255, 285), (25,)), "and not everywhere")
            hand("key", "Escape")
            viewer.wait()


def test_keys_write_a_log_and_a_film(user):
    user.path("touch.x3dv").write_text(TOUCH.replace("startTime -100", "loop TRUE"))
    with display():
        viewer = view(user, "touch.x3dv")
        window_of(viewer)
        hand("key", "ctrl+l")
        hand("key", "ctrl+f")
        time.sleep(2)
        hand("key", "ctrl+f")
        time.sleep(1)
        hand("key", "Escape")  # ends the log as well
        viewer.done()
    report = user.run("info", "rtsg-1.rlog", "--json")
    check(report["frames"] > 20 and report["closed"], f"a whole log: {report}")
    film = user.path("rtsg-1.mp4").read_bytes()
    check(film[4:8] == b"ftyp" and b"moov" in film, "a whole film")


def test_a_window_that_is_closed_ends_in_order(user):
    user.path("touch.x3dv").write_text(TOUCH)
    with display():
        viewer = view(user, "touch.x3dv", "--screenshot", "last.png")
        found = window_of(viewer)
        hand("windowsize", found, 320, 200)
        time.sleep(1)
        hand("key", "Escape")
        viewer.done()
    check(is_whole_png(user.path("last.png")), "the picture of the end")
    equal(int.from_bytes(user.path("last.png").read_bytes()[16:20], "big"), 320, "as wide as the window was then")


def by_ogre(user, *arguments, status=0):
    """Runs it; where the rasteriser is not there, or has no OpenGL, the test is skipped."""
    program = user.start(*arguments)
    if program.wait() == 1 and "rasteriser" in program.err:
        raise Skipped(program.err.strip())
    return program.done(status)


def is_seen(wanted):
    end = time.monotonic() + 60
    while not wanted() and time.monotonic() < end:
        time.sleep(0.2)
    return wanted()


def test_ogre_draws_the_window_and_everything_else_is_the_same(user):
    user.path("touch.x3dv").write_text(TOUCH)
    user.path("moved.x3dv").write_text(TOUCH.replace("Viewpoint { position 0 0 6 }\n", ""))
    with display():
        by_ogre(user, "render", "moved.x3dv", "--integrator", "raster", "-o", "same.png", "--size", "400x300")
        viewer = view(user, "touch.x3dv", "--renderer", "ogre", "--screenshot", "far.png")
        window_of(viewer)
        check(is_seen(lambda: any(red > 200 and green < 60 for red, green, blue in colours_in((150,), (200,)))), "the box is on the screen")
        hand("key", "Next")  # PGDN: the viewpoint far away
        check(is_seen(lambda: all(red < 60 for red, green, blue in colours_in((150,), (230,)))), "it is far away on the screen, too")
        hand("key", "F1")
        check(is_shown(viewer), "there is a panel over it")
        hand("key", "F1")
        hand("key", "ctrl+s")
        check(is_seen(lambda: "picture written" in viewer.err), "a picture by a key")
        time.sleep(1)
        hand("key", "Escape")
        viewer.done()
        equal(user.path("far.png").read_bytes(), user.path("same.png").read_bytes(), "the picture from that viewpoint")
        check(is_whole_png(user.path("rtsg-1.png")), "and it is whole")
        server, endpoint = user.serve("touch.x3dv", "--upstream", "events", "--record", "touch.rlog", "--fps", "30")
        viewer = view(user, endpoint, "--name", "Ann", "--renderer", "ogre")
        window_of(viewer)
        hand("mousemove", 200, 150)
        time.sleep(0.5)
        hand("mousedown", 1)
        time.sleep(0.3)
        hand("mouseup", 1)
        time.sleep(1)
        hand("key", "Escape")
        viewer.done()
        server.signal(signal.SIGINT)
        server.wait()
    program = user.start("replay", "touch.rlog", "--blame", "T.rotation")
    program.done()
    check("Ann (from a pointer" in program.out, f"what was clicked in its picture turned: {program.out!r}")


def test_text_in_a_layer_of_a_served_scene_is_clicked_after_a_walk(user):
    shutil.copy(ROOT / "examples" / "hud.x3dv", user.path("hud.x3dv"))
    with display():
        server, endpoint = user.serve("hud.x3dv", "--upstream", "events", "--record", "hud.rlog", "--fps", "30")
        viewer = view(user, endpoint, "--name", "Ann")
        window_of(viewer)
        hand("keydown", "Up")
        time.sleep(1)
        hand("keyup", "Up")
        time.sleep(0.5)
        # 0.38 to the right, 0.26 down and 1 ahead of an eye whose picture is 2 tan(pi / 8) high there.
        hand("mousemove", 200 + round(150 * 0.38 / 0.4142), 150 + round(150 * 0.26 / 0.4142))
        time.sleep(0.5)
        hand("mousedown", 1)
        time.sleep(0.5)
        hand("mouseup", 1)
        time.sleep(0.5)
        hand("mousemove", 200, 150)
        time.sleep(0.3)
        hand("key", "Escape")
        viewer.done()
        server.signal(signal.SIGINT)
        server.wait()
    program = user.start("replay", "hud.rlog", "--blame", "ABOVE.isBound")
    program.done()
    check("Ann (from a pointer" in program.out, f"the layer's text was clicked: {program.out!r}")


def test_text_that_a_sensor_keeps_before_the_eye_of_a_served_scene_is_clicked_after_a_walk(user):
    shutil.copy(ROOT / "examples" / "hud.x3dv", user.path("hud.x3dv"))
    for renderer in ("light", "ogre"):
        with display():
            server, endpoint = user.serve("hud.x3dv", "--upstream", "events", "--record", f"{renderer}.rlog", "--fps", "30")
            viewer = view(user, endpoint, "--name", "Ann", "--renderer", renderer)
            window_of(viewer)
            for key in ("Up", "Left"):
                hand("keydown", key)
                time.sleep(0.7)
                hand("keyup", key)
            time.sleep(0.5)
            # 0.38 to the left, 0.26 down and 1 ahead of one's own eye; the origin's viewer has not moved.
            x, y = 200 - round(150 * 0.38 / 0.4142), 150 + round(150 * 0.26 / 0.4142)
            letters = lambda: colours_in(range(y - 8, y + 9, 2), range(x - 30, x + 31, 2))
            check(is_seen(lambda: any(red > 180 and blue < 150 for red, green, blue in letters())),
                  f"the sign is there in the picture by {renderer}")
            hand("mousemove", x, y)
            time.sleep(0.5)
            hand("mousedown", 1)
            time.sleep(0.5)
            hand("mouseup", 1)
            time.sleep(0.5)
            hand("key", "Escape")
            viewer.done()
            server.signal(signal.SIGINT)
            server.wait()
        program = user.start("replay", f"{renderer}.rlog", "--blame", "LAMP.on")
        program.done()
        check("Ann (from a pointer" in program.out, f"it was clicked in the picture by {renderer}: {program.out!r}")


@contextlib.contextmanager
def nobody_looks():
    """Windows without a screen."""
    before = {key: os.environ.get(key) for key in ("DISPLAY", "SDL_VIDEODRIVER")}
    os.environ.pop("DISPLAY", None)
    os.environ["SDL_VIDEODRIVER"] = "offscreen"
    yield
    for key, value in before.items():
        os.environ.pop(key, None) if value is None else os.environ.__setitem__(key, value)


def test_without_a_display_ogre_says_so(user):
    user.path("touch.x3dv").write_text(TOUCH)
    with nobody_looks():
        viewer = view(user, "touch.x3dv", "--renderer", "ogre", "--for", "1s")
        equal(viewer.wait(), 1, "status")
        check("rasteriser" in viewer.err, f"it is named: {viewer.err!r}")
        viewer = view(user, "touch.x3dv", "--renderer", "ogre", "--shadows", "all", "--for", "1s")
        equal(viewer.wait(), 2, "shadows by OGRE are no use of it")


def title_of(window):
    return subprocess.run(["xdotool", "getwindowname", window], capture_output=True, text=True).stdout


def test_a_window_outlives_its_server_and_finds_the_next(user):
    user.path("spin.x3dv").write_text(TOUCH.replace("startTime -100", "loop TRUE"))
    with display():
        server, endpoint = user.serve("spin.x3dv", "--fps", "30")
        viewer = view(user, endpoint)
        window = window_of(viewer)
        server.signal(signal.SIGKILL)
        server.wait()
        check(is_seen(lambda: "out of reach" in title_of(window)), f"the title says so: {title_of(window)!r}")
        time.sleep(7)
        check(viewer.process.poll() is None, f"the window is still there: {viewer.err!r}")
        check("is out of reach" in viewer.err, f"the terminal says so: {viewer.err!r}")
        server, endpoint = user.serve("spin.x3dv", "--fps", "30")
        check(is_seen(lambda: "equal" in title_of(window)), f"it follows the next: {title_of(window)!r}")
        check("is back" in viewer.err, f"and says so: {viewer.err!r}")
        server.signal(signal.SIGINT)
        server.wait()
        check(is_seen(lambda: "ended" in title_of(window)), f"one that ends in order is named: {title_of(window)!r}")
        hand("key", "Escape")
        viewer.done()


PARALLEL = """#X3D V4.0 utf8
PROFILE Full
NavigationInfo { type "EXAMINE" }
OrthoViewpoint { position 0 0 10 fieldOfView [ -4 -4 4 4 ] }
Shape { appearance Appearance { material UnlitMaterial { emissiveColor 1 0 0 } } geometry Box { size 2 2 8 } }
Transform { translation 3 0 0 children Shape { appearance Appearance { material UnlitMaterial { emissiveColor 0 1 0 } } geometry Sphere { radius .5 } } }
"""


def red_columns():
    """How many of the middle row's pixels are red."""
    return sum(red > 180 and green < 80 for red, green, blue in row_of(150))


def row_of(y):
    width, pixels = picture_of_screen()
    line = pixels[3 * y * width:3 * (y * width + 400)]
    return [tuple(line[i:i + 3]) for i in range(0, len(line), 3)]


def test_a_parallel_view_stays_parallel_and_the_wheel_enlarges_it(user):
    user.path("ortho.x3dv").write_text(PARALLEL)
    with display():
        for served in (False, True):
            if served:
                server, what = user.serve("ortho.x3dv", "--fps", "30")
            viewer = view(user, what if served else "ortho.x3dv")
            window_of(viewer)
            # 2 m of 8 in 300 pixels, whatever the depth; a perspective shows the front of the box larger.
            check(is_seen(lambda: abs(red_columns() - 75) <= 3), f"at first: {red_columns()}")
            hand("mousemove", 200, 150)
            for _ in range(8):
                hand("click", 4)
            check(is_seen(lambda: abs(red_columns() - 75 / .9 ** 8) <= 6), f"larger by the wheel: {red_columns()}")
            for _ in range(8):
                hand("click", 5)
            check(is_seen(lambda: abs(red_columns() - 75) <= 3), f"and as before: {red_columns()}")
            hand("keydown", "Up")
            time.sleep(.4)
            hand("keyup", "Up")
            time.sleep(.5)
            check(abs(red_columns() - 75) <= 3, f"from above it is as wide: {red_columns()}")
            hand("key", "Escape")
            viewer.done()
            if served:
                server.signal(signal.SIGINT)
                server.wait()


def test_what_cannot_be_shown_is_said_in_the_terminal_and_the_window(user):
    user.path("lack.x3dv").write_text(TOUCH.replace("material UnlitMaterial", 'texture ImageTexture { url "nothere.png" } material UnlitMaterial'))
    is_yellow = lambda rows: any(red > 190 and 140 < green < 215 and blue < 140 for red, green, blue in colours_in(rows, range(20, 380)))
    with display():
        viewer = view(user, "lack.x3dv")
        window_of(viewer)
        check(is_seen(lambda: "ImageTexture shows no picture" in viewer.err), f"the terminal has it: {viewer.err!r}")
        check(is_seen(lambda: is_yellow(range(255, 295))), "and the window")
        hand("key", "F3")
        check(is_seen(lambda: is_yellow(range(165, 290))), "the list has it")
        hand("key", "Escape")  # closes the list, and then the window
        hand("key", "Escape")
        viewer.done()


OTHER = """#X3D V4.0 utf8
PROFILE Immersive
NavigationInfo { type "NONE" }
Viewpoint { position 0 0 6 }
Shape { appearance Appearance { material UnlitMaterial { emissiveColor 0 0 1 } } geometry Box { size 3 3 3 } }
"""


def middle():
    return row_of(150)[260]  # beside the pointer, which X draws into the picture


def test_an_anchor_opens_another_scene_and_there_is_a_way_back(user):
    user.path("other.x3dv").write_text(OTHER)
    user.path("first.x3dv").write_text(OTHER.replace("Shape {", 'Anchor { url "other.x3dv" description "onwards" children Shape {').replace("0 0 1 }", "1 0 0 }") + "}\n")
    with display():
        viewer = view(user, "first.x3dv")
        window = window_of(viewer)
        check(is_seen(lambda: middle()[0] > 200), "the first is red")
        hand("mousemove", 200, 150)
        time.sleep(.5)
        hand("click", 1)
        check(is_seen(lambda: "other.x3dv" in title_of(window_of(viewer)) and middle()[2] > 200), f"the other is blue: {viewer.err!r}")
        hand("key", "ctrl+BackSpace")
        check(is_seen(lambda: "first.x3dv" in title_of(window_of(viewer)) and middle()[0] > 200), "and the first again")
        hand("key", "Escape")
        viewer.done()


def test_a_file_with_errors_leaves_the_scene_that_is_there(user):
    user.path("only").mkdir()
    user.path("only/broken.x3dv").write_text(OTHER[:-20])
    user.path("only/first.x3dv").write_text(TOUCH)
    with display():
        viewer = view(user, "only/first.x3dv")
        window = window_of(viewer)
        check(is_seen(lambda: middle()[0] > 200), "the first is red")
        hand("key", "ctrl+o")
        time.sleep(.7)
        for y in range(64, 130, 6):  # its line in the list of files, below the folder above
            hand("mousemove", 60, y, "click", 1)
            time.sleep(.05)
            if "broken.x3dv" in viewer.err:
                break
        check(is_seen(lambda: "is not opened" in viewer.err and "first.x3dv goes on" in viewer.err), f"it says why: {viewer.err!r}")
        check(is_seen(lambda: middle()[0] > 200), "the first goes on")
        check("first.x3dv" in title_of(window), title_of(window))
        hand("key", "Escape")
        viewer.done(1)


TRAPPED = """#X3D V4.0 utf8
PROFILE Full
NavigationInfo { type "WALK" }
Viewpoint { position 0 1.6 -0.1 }
DEF PS ProximitySensor { size 1e5 1e5 1e5 }
DEF S Script { eventIn SFVec3f at url "ecmascript:function at(v) { if (v.z < -3) print('outside'); }" }
ROUTE PS.position_changed TO S.at
Transform { translation 0 -0.05 0 children Shape { geometry Box { size 50 0.1 50 } } }
Transform { translation 0 1 0 children Shape { geometry Box { size 10 4 0.6 } } }
"""


def test_one_gets_out_of_a_wall(user):
    user.path("trapped.x3dv").write_text(TRAPPED)
    with display():
        viewer = view(user, "trapped.x3dv")
        window_of(viewer)
        hand("keydown", "Up")
        time.sleep(1)
        hand("keyup", "Up")
        check("outside" not in viewer.out, "the wall holds")
        hand("key", "F7")
        time.sleep(.3)
        hand("keydown", "Up")
        check(is_seen(lambda: "outside" in viewer.out), f"the way out: {viewer.out!r} {viewer.err!r}")
        hand("keyup", "Up")
        hand("key", "Escape")
        viewer.done()


def test_keys_work_on_a_russian_keyboard(user):
    user.path("touch.x3dv").write_text(TOUCH)
    if not shutil.which("setxkbmap"):
        raise Skipped("setxkbmap is not installed")
    with display():
        subprocess.run(["setxkbmap", "ru"], check=True)
        viewer = view(user, "touch.x3dv")
        window_of(viewer)
        hand("keydown", 37, "keydown", 39, "keyup", 39, "keyup", 37)  # the keys Control and S by their numbers
        check(is_seen(lambda: "picture written" in viewer.err), f"a picture: {viewer.err!r}")
        check(is_whole_png(user.path("rtsg-1.png")), "it is there")
        hand("key", "Escape")
        viewer.done()


def seconds_of(program):
    """CPU time."""
    fields = pathlib.Path(f"/proc/{program.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_a_hidden_window_draws_nothing(user):
    user.path("spin.x3dv").write_text(TOUCH.replace("startTime -100", "loop TRUE"))
    with display():
        viewer = view(user, "spin.x3dv")
        window = window_of(viewer)
        hand("windowunmap", window)
        time.sleep(1)
        begun = seconds_of(viewer)
        time.sleep(3)
        hidden = seconds_of(viewer) - begun
        hand("windowmap", window)
        time.sleep(1)
        begun = seconds_of(viewer)
        time.sleep(3)
        seen = seconds_of(viewer) - begun
        check(hidden < seen / 3, f"hidden {hidden:.2f} s, seen {seen:.2f} s of the processor in 3 s")
        hand("windowfocus", window)  # no window manager gives it back
        hand("key", "Escape")
        viewer.wait()


def test_the_bar_chooses_how_one_moves(user):
    user.path("touch.x3dv").write_text(TOUCH)
    with display():
        viewer = view(user, "touch.x3dv", "--bar")
        window_of(viewer)
        edge = lambda: max(row_of(1)[390])
        check(is_seen(lambda: 10 < edge() < 60 and middle()[0] > 200), "there is a bar over the picture")
        hand("key", "question")
        check(is_seen(lambda: middle()[0] < 150), "a list of keys over the picture")
        hand("key", "question")
        check(is_seen(lambda: middle()[0] > 200), "and the same key hides it")
        for x in range(390, 0, -12):  # along the bar without its last row, which has what hides it
            for y in (14, 38):
                if "picture written" not in viewer.err:
                    hand("mousemove", x, y, "click", 1)
                    time.sleep(.15)
        check(is_seen(lambda: "picture written" in viewer.err), f"a button of the bar writes a picture: {viewer.err!r}")
        hand("key", "F2")
        check(is_seen(lambda: edge() < 5), "a key hides the bar")
        hand("key", "Escape")
        hand("key", "Escape")
        viewer.done()


def test_a_server_that_ends_or_is_lost_ends_the_window_of_a_script(user):
    user.path("spin.x3dv").write_text(TOUCH.replace("startTime -100", "loop TRUE"))
    with nobody_looks():
        server, endpoint = user.serve("spin.x3dv", "--fps", "30")
        viewer = view(user, endpoint, "--wait", "60s", "--screenshot", "last.png")
        time.sleep(2)
        server.signal(signal.SIGINT)
        server.wait()
        viewer.done()  # the server has left in order
        check(is_whole_png(user.path("last.png")), "a picture of the last state is written")
        server, endpoint = user.serve("spin.x3dv", "--fps", "30")
        viewer = view(user, endpoint, "--wait", "1s", "--screenshot", "lost.png")
        time.sleep(2)
        server.signal(signal.SIGKILL)
        server.wait()
        viewer.done(1)
        check("silent for 1 s" in viewer.err, f"it is named: {viewer.err!r}")
        check(is_whole_png(user.path("lost.png")), "what was there last")


def held(program):
    """Bytes of memory, files and threads of a process."""
    at = pathlib.Path(f"/proc/{program.process.pid}")
    status = (at / "status").read_text()
    number = lambda name: int(re.search(name + r":\s+(\d+)", status).group(1))
    return 1024 * number("VmRSS"), len(list((at / "fd").iterdir())), number("Threads")


def stays_flat(programs, seconds, step=lambda: time.sleep(0.5)):
    """Memory, files and threads after half of the time, and at its end; the long form is that of ./dev soak."""
    begun = time.monotonic()
    before = None
    while time.monotonic() < begun + seconds:
        if before is None and time.monotonic() > begun + seconds / 2:
            before = [held(program) for program in programs]
        step()
    for (memory, files, threads), program in zip(before, programs):
        memory_now, files_now, threads_now = held(program)
        print(f"after {seconds / 2:.0f} and {seconds:.0f} s: {memory >> 20} and {memory_now >> 20} MiB, {files} and {files_now} files, "
              f"{threads} and {threads_now} threads")
        check(memory_now - memory < 24 << 20, f"memory grows: {memory >> 20} MiB, {memory_now >> 20} MiB later on")
        check(files_now <= files + 2, f"files stay open: {files}, {files_now} later on")
        check(threads_now <= threads + 1, f"threads stay: {threads}, {threads_now} later on")


# Something is made and taken away all the time, and the box turns.
NEVER_STILL = TOUCH.replace("startTime -100", "loop TRUE") + """
DEF G Group { }
DEF EVERY TimeSensor { cycleInterval .05 loop TRUE }
DEF S Script { directOutput TRUE field SFNode g USE G eventIn SFTime tick
  url "ecmascript:function tick(v) { g.children = new MFNode(Browser.createX3DFromString('Shape { geometry Sphere { radius .2 } }')[0]); }" }
ROUTE EVERY.cycleTime TO S.tick
"""


def test_a_scene_that_never_stands_still_keeps_its_window_and_its_memory(user):
    user.path("spin.x3dv").write_text(NEVER_STILL)
    seconds = 600 if LONG else 8
    with nobody_looks():
        viewer = view(user, "spin.x3dv", "--for", f"{seconds + 2}s")
        stays_flat([viewer], seconds)
        report = viewer.done()
    check(report["pictures"] > seconds / 8 and report["sequence"] > seconds, f"pictures come all the time: {report}")


def test_a_walk_in_a_served_scene_that_changes_keeps_memory_files_and_threads(user):
    user.path("spin.x3dv").write_text(NEVER_STILL)
    seconds = 600 if LONG else 10
    keys = ("Up", "Left", "Down", "Right", "Next", "F1")
    steps = 0

    def walk():
        nonlocal steps
        key = keys[steps % len(keys)]
        steps += 1
        hand("keydown", key)
        time.sleep(0.4)
        hand("keyup", key)

    with display():
        server, endpoint = user.serve("spin.x3dv", "--fps", "30")
        viewer = view(user, endpoint, "--name", "Ann", "--wait", "60s")
        window_of(viewer)
        stays_flat([viewer, server], seconds, walk)
        hand("key", "Escape")
        report = viewer.done()
        server.signal(signal.SIGINT)
        server.wait()
    check(report["events"] >= steps and report["pictures"] > seconds / 8, f"it was walked through: {report}")


@only_long
def test_windows_that_close_while_pictures_come_end_well(user):
    user.path("spin.x3dv").write_text(TOUCH.replace("startTime -100", "loop TRUE"))
    with display():
        for i in range(200):
            user.run("view", "spin.x3dv", "--mute", "--size", "200x120", "--fps", "200", "--for", f"{100 + i}ms")


if __name__ == "__main__":
    sys.exit(run(sys.modules[__name__]))
