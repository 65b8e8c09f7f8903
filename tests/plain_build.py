#!/usr/bin/env python3
"""Do sources compile each by itself, without precompiled headers?

usage: plain_build.py --build BUILD [--part N] [--parts N] [--compiler C]

That is CMake's default, which CI builds in no other step. One part of all sources, tests and benches included, by -fsyntax-only: the commit says
which one, so that each has its turn. What is generated comes from a build that has been made. Exit status 1 and what the compiler says for each fault.
"""
import argparse
import concurrent.futures
import os
import resource
import subprocess
import sys
import tempfile

import options_off


def turn(parts):
    """The part that belongs to the commit; the first without Git."""
    said = subprocess.run(["git", "-C", options_off.SOURCE, "rev-parse", "HEAD"], capture_output=True, text=True, check=False).stdout.strip()
    return int(said or "0", 16) % parts


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", required=True, help="a build folder, for what is generated")
    parser.add_argument("--parts", type=int, default=60)
    parser.add_argument("--part", type=int, help="from 0")
    parser.add_argument("--cmake", default="cmake")
    parser.add_argument("--generator", default="Ninja")
    parser.add_argument("--compiler", default="c++")
    arguments = parser.parse_args()
    part = turn(arguments.parts) if arguments.part is None else arguments.part
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        commands = options_off.configure(arguments, folder, {"TESTS": True})
        of_file = {file: command for command, (file, *_) in commands.items() if file.endswith(".cpp")}  # once each
        chosen = sorted(of_file)[part::arguments.parts]
        said = pool.map(lambda file: options_off.fault(of_file[file], ["-fsyntax-only", "-O0"], folder, os.path.abspath(arguments.build)), chosen)
        faults = [text for text in said if text]
    print("\n".join(faults))
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"part {part} of {arguments.parts}: {len(chosen)} of {len(of_file)} sources, {len(faults)} wrong, {used.ru_utime + used.ru_stime:.0f} s of CPU time")
    return 1 if faults or not chosen else 0


if __name__ == "__main__":
    sys.exit(main())
