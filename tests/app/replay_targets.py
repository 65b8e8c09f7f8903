#!/usr/bin/env python3
"""What rtsg_add_replay_test makes of a project: tests that leave reports, and a target that records all of them anew.

usage: replay_targets.py --program RTSG [--cmake CMAKE] [--generator NAME]
"""
import argparse
import pathlib
import subprocess
import sys
import tempfile

MODULE = pathlib.Path(__file__).resolve().parents[2] / "cmake" / "RtsgReplayTest.cmake"
SCENE = """#X3D V4.0 utf8
PROFILE Full
DEF CLOCK TimeSensor { cycleInterval 2 loop TRUE }
DEF WAY PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 1 0 0 ] }
DEF BOX Transform { }
ROUTE CLOCK.fraction_changed TO WAY.set_fraction
ROUTE WAY.value_changed TO BOX.translation
"""
PROJECT = """cmake_minimum_required(VERSION 3.25)
project(user LANGUAGES NONE)
enable_testing()
add_executable(rtsg::rtsg IMPORTED GLOBAL)
set_target_properties(rtsg::rtsg PROPERTIES IMPORTED_LOCATION "{program}")
include("{module}")
rtsg_add_replay_test(NAME a_missing LOG none.rlog SCENE scene.x3dv)
rtsg_add_replay_test(NAME moved LOG moved.rlog SCENE scene.x3dv)
rtsg_add_replay_test(NAME z_missing LOG nowhere.rlog SCENE scene.x3dv)
rtsg_add_replay_test(NAME whole LOG whole.rlog)
"""


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", required=True)
    parser.add_argument("--cmake", default="cmake")
    parser.add_argument("--generator")
    arguments = parser.parse_args()
    wrong = []

    def check(holds, what):
        if not holds:
            wrong.append(what)

    with tempfile.TemporaryDirectory(prefix="rtsg-") as place:
        folder = pathlib.Path(place)

        def run(*command):
            done = subprocess.run([str(c) for c in command], cwd=folder, capture_output=True, text=True, timeout=300)
            return done.returncode, done.stdout + done.stderr

        scene = folder / "scene.x3dv"
        scene.write_text(SCENE)
        for log in ("moved.rlog", "whole.rlog"):
            status, said = run(arguments.program, "record", scene, "-o", log, "--for", "1s")
            check(status == 0, f"recorded: {said}")
        scene.write_text(SCENE.replace("1 0 0", "2 0 0"))
        (folder / "CMakeLists.txt").write_text(PROJECT.format(program=arguments.program, module=MODULE))
        generator = ["-G", arguments.generator] if arguments.generator else []
        status, said = run(arguments.cmake, "-S", ".", "-B", "build", *generator)
        check(status == 0, f"configured: {said}")

        def rerun():
            return run(arguments.program, "replay", "moved.rlog", "--rerun", scene)[0]

        check(rerun() == 1, "the scene is another now")
        status, said = run(arguments.cmake, "--build", "build", "--target", "update_replay_tests")
        check(status != 0 and "not recorded anew: a_missing z_missing" in said, f"those without a log are named: {said}")
        check("a_missing.html shows why" in said, f"nothing differed where nothing ran: {said}")
        check(rerun() == 0, f"the other one was recorded anew: {said}")
        status, said = run(arguments.cmake, "--build", "build", "--target", "z_missing.update")
        check(status != 0, f"alone it fails, too: {said}")
        ctest = pathlib.Path(arguments.cmake).with_name("ctest") if "/" in arguments.cmake else "ctest"
        status, said = run(ctest, "--test-dir", "build", "-R", "moved|whole")
        check(status == 0, f"they pass: {said}")
        for test in ("moved", "whole"):
            check((folder / "build" / "replay_tests" / f"{test}.xml").exists(), f"{test} leaves JUnit XML")
    for what in wrong:
        print(f"wrong: {what}", file=sys.stderr)
    print(f"{len(wrong)} wrong")
    sys.exit(1 if wrong else 0)


main()
