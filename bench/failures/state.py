"""Situations in which touch, mirrors, logs and numbers fail. Truths are what a user expects: the place where a hand is, the same bits."""
import pathlib

from situation import Outcome, Situation, short

MOVED = "DEF MOVED Transform { children Shape { geometry Box { size 1 1 1 } } }\n"


def forces(program, text, path):
    """The summary of rtsg touch along a path of (seconds, x, y, z), and what it says beside it."""
    file = program.folder / "path.csv"
    file.write_text("seconds,x,y,z\n" + "".join(f"{t:g},{x:g},{y:g},{z:g}\n" for t, x, y, z in path))
    return program.object("touch", program.scene(text), "--device", f"sim:{file}", "--json")


def bounded(answer, said):
    """Whether the largest force is at most what --max-force allows."""
    force = float(answer["largest_force_n"]) if answer else None
    return Outcome("touch, force is bounded", None if force is None else float(force <= 5), 1, 0, "", said, f"{force} N")


def touch(program):
    sheet = "Transform { translation 0 0 0 children Shape { appearance Appearance { material Material {} } geometry Box { size 2 .001 2 } } }\n"
    for speed in (.1, 1, 10, 50):
        answer, said = forces(program, sheet, [(0, 0, .1, 0), (.2 / speed, 0, -.1, 0), (.2 / speed + .2, 0, -.1, 0)])
        force = float(answer["largest_force_n"]) if answer else None
        yield Situation("touch", f"a sheet of 1 mm, crossed at {speed:g} m/s", "a step of a tick jumps over it", "the hand is held: the largest force, 5 N",
                        [Outcome("touch", force, 5, .01, "N", said)])
    inside = "Shape { appearance Appearance { material Material {} } geometry Box { size 1 1 1 } }\n"
    answer, said = forces(program, inside, [(0, 0, 0, 0), (1, 0, 0, 0)])
    yield Situation("touch", "a hand that begins inside", "no side to push it to", "at most 5 N: 1", [bounded(answer, said)])
    walls = ("DEF A Transform { translation -1 0 0 children Shape { appearance Appearance { material Material {} } geometry Box { size 1 1 1 } } }\n"
             "DEF B Transform { translation 1 0 0 children Shape { appearance Appearance { material Material {} } geometry Box { size 1 1 1 } } }\n"
             "DEF T TimeSensor { cycleInterval 1 loop FALSE startTime 946684800 }\n"
             "DEF PA PositionInterpolator { key [ 0 1 ] keyValue [ -1 0 0, -.45 0 0 ] }\nDEF PB PositionInterpolator { key [ 0 1 ] keyValue [ 1 0 0, .45 0 0 ] }\n"
             "ROUTE T.fraction_changed TO PA.set_fraction\nROUTE T.fraction_changed TO PB.set_fraction\n"
             "ROUTE PA.value_changed TO A.set_translation\nROUTE PB.value_changed TO B.set_translation\n")
    answer, said = forces(program, walls, [(0, 0, 0, 0), (1.5, 0, 0, 0)])
    yield Situation("touch", "a hand between closing walls", "two faces push at once", "at most 5 N: 1", [bounded(answer, said)])


def numbers(program):
    for name, value in (("NaN in an event", "nan 0 0"), ("infinity in an event", "inf 0 0")):
        status, _, err = program.run("run", program.scene(MOVED), "--for", "1s", "--set", f"MOVED.translation={value}@.5")
        yield Situation("numbers", name, "NaN spreads through boxes and trees", "refused",
                        [Outcome("run --set", float(status == 0), 0, 0, "", err.strip().splitlines()[0] if err.strip() else "", "1 is status 0")])
    for name, value in (("a denormal number", "1e-42 0 0"), ("the largest number", "3.4028235e38 0 0"), ("minus zero", "-0 0 0")):
        log = program.folder / "numbers.rlog"
        log.unlink(missing_ok=True)
        scene = program.scene(MOVED)
        made, _, _ = program.run("record", scene, "-o", log, "--for", "1s", "--set", f"MOVED.translation={value}@.5")
        status, _, err = program.run("replay", log, "--verify")
        yield Situation("numbers", name + " in a log", "flushed to zero, or rounded", "the same hashes in the replay",
                        [Outcome("record; replay --verify", float(made == 0 and status == 0), 1, 0, "", err.strip()[:100])])
    for name, text in (("a scale of zero", "Transform { scale 0 1 1 children Shape { appearance Appearance { material Material {} } geometry Box { } } }\n"),
                       ("a scale of 1e-30", "Transform { scale 1e-30 1 1 children Shape { appearance Appearance { material Material {} } geometry Box { } } }\n"),
                       ("a rotation without axis", "Transform { rotation 0 0 0 1 children Shape { appearance Appearance { material Material {} } geometry Box { } } }\n"),
                       ("corners at 1e38", "Shape { appearance Appearance { material Material {} } geometry TriangleSet { solid FALSE coord Coordinate { point [ 1e38 0 0, -1e38 1e38 0, 0 -1e38 1 ] } } }\n")):
        answer, said = program.object("render", program.scene("Viewpoint { }\n" + text), "-o", program.folder / "n.png", "--size", "32x18", "--json")
        yield Situation("numbers", name, "matrices without inverse, boxes without end", "a picture, and a word where a shape is left out",
                        [Outcome("render", float(answer is not None), 1, 0, "", said or (f"missing: {answer['missing']}" if answer and answer.get("missing") else ""))])


def logs(program):
    log = program.folder / "torn.rlog"
    log.unlink(missing_ok=True)
    moving = MOVED + ("DEF T TimeSensor { cycleInterval 1 loop TRUE }\nDEF P PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 1 0 0 ] }\n"
                      "ROUTE T.fraction_changed TO P.set_fraction\nROUTE P.value_changed TO MOVED.set_translation\n")
    program.run("record", program.scene(moving), "-o", log, "--for", "4s")
    whole = pathlib.Path(log).read_bytes()
    torn, bent = program.folder / "cut.rlog", program.folder / "bent.rlog"
    torn.write_bytes(whole[:len(whole) * 3 // 4])
    bent.write_bytes(whole[:len(whole) // 2] + bytes([whole[len(whole) // 2] ^ 4]) + whole[len(whole) // 2 + 1:])
    for name, path in (("a log that lost its end", torn), ("a log with one wrong bit", bent)):
        status, out, err = program.run("replay", path, "--verify")
        yield Situation("logs", name, "half a record that looks whole", "said, with the place",
                        [Outcome("replay --verify", float(status == 0), 0, 0, "", short((err or out).strip()), "1 is status 0")])


def situations(program):
    for group in (touch, numbers, logs):
        yield from group(program)
