#!/usr/bin/env python3
"""Does what changes compile when a part is left out of the build?

For each RTSG_ option of CMake that leaves a part out: the sources that only a build without it compiles, or compiles with other
definitions, by -fsyntax-only; of those that lose a folder of headers, whether all they include is there. What is generated comes from a
build that has been made. Exit status 1 and what the compiler says for each fault.
"""
import argparse
import concurrent.futures
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time

SOURCE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
# Options that leave a part of the program out when they are OFF; all others choose how it is built.
HOW = {"TESTS", "PCH", "WERROR", "FUZZ", "LONG", "DELAY_LOAD", "STATE_ALONE", "MODULES"}


def options():
    with open(os.path.join(SOURCE, "cmake", "RtsgOptions.cmake"), encoding="utf-8") as file:
        found = re.findall(r"^option\(RTSG_(\w+)", file.read(), re.MULTILINE)
    return [name for name in found if name not in HOW]


def configure(arguments, folder, values):
    flags = [f"-DRTSG_{name}={'ON' if on else 'OFF'}" for name, on in values.items()]
    run = subprocess.run([arguments.cmake, "-S", SOURCE, "-B", folder, "-G", arguments.generator, f"-DCMAKE_CXX_COMPILER={arguments.compiler}",
                          "-DCMAKE_BUILD_TYPE=Release", "-DRTSG_TESTS=OFF", "-DRTSG_PCH=OFF", "-DRTSG_WERROR=ON", *flags],
                         capture_output=True, text=True, check=False)
    if run.returncode:
        sys.exit(f"CMake failed with {' '.join(flags)}:\n{run.stderr}")
    with open(os.path.join(folder, "compile_commands.json"), encoding="utf-8") as file:
        entries = [entry for entry in json.load(file) if os.path.exists(entry["file"])]
    return {entry["command"]: (entry["file"], *re.findall(r" -D\S+", entry["command"])) for entry in entries}


def fault(command, how, folder, build):
    """What the compiler says against it; empty if nothing."""
    words = shlex.split(command.replace(folder, build))
    at = words.index("-o")
    words[at:at + 2] = how
    run = subprocess.run(words, cwd=build, capture_output=True, text=True, check=False)
    return run.stderr if run.returncode else ""


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", required=True, help="a build folder, for what is generated")
    parser.add_argument("--cmake", default="cmake")
    parser.add_argument("--generator", default="Ninja")
    parser.add_argument("--compiler", default="c++")
    arguments = parser.parse_args()
    build = os.path.abspath(arguments.build)
    failed = False
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(2) as pool:
        names = options()
        whole = configure(arguments, folder, dict.fromkeys(names, True))
        for name in names:
            begun = time.monotonic()
            less = configure(arguments, folder, {one: one != name for one in names})
            changed = {command: ["-fsyntax-only", "-O0"] if defined not in whole.values() else ["-M", "-MF", os.devnull]
                       for command, defined in less.items() if command not in whole}
            said = pool.map(lambda one: fault(*one, folder, build), changed.items())
            faults = [text for text in said if text]
            print(f"RTSG_{name}=OFF: {len(changed)} sources, {len(faults)} wrong, {time.monotonic() - begun:.1f} s", flush=True)
            for text in faults:
                print(text)
            failed |= bool(faults)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
