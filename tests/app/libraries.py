#!/usr/bin/env python3
"""How many libraries of the distribution does the program load for a scene without scripts?

usage: libraries.py --program RTSG

Runs each verb that draws and sounds nothing, and lists what the dynamic loader has loaded by its end, at once or later. The parts of the C and
C++ libraries, the sanitizers' and the program's own do not count. Exit status 1, and their names, where one has loaded more than MOST.
"""
import argparse
import os
import pathlib
import re
import subprocess
import sys
import tempfile

MOST = 15
NOT_COUNTED = re.compile(r"^(librtsg_.*|ld-linux.*|linux-vdso|lib(c|m|dl|rt|pthread|resolv|stdc\+\+|gcc_s|asan|ubsan|tsan|lsan))\.so")
SCENES = pathlib.Path(__file__).resolve().parent.parent / "logs"


def loaded(folder, name):
    """By all processes that wrote their reports under this name."""
    found = set()
    for report in folder.glob(f"{name}.*"):
        text = report.read_text(errors="replace")
        found.update(os.path.basename(file) for file in re.findall(r"file=(\S+) \[\d+\];  generating link map", text))
    return sorted(file for file in found if not NOT_COUNTED.match(file))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", required=True, type=lambda path: str(pathlib.Path(path).resolve()))
    program = parser.parse_args().program
    failed = False
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        reports = folder / "reports"
        reports.mkdir()

        def start(verb, *arguments):
            environment = {**os.environ, "LD_DEBUG": "files", "LD_DEBUG_OUTPUT": str(reports / verb.strip("-"))}
            return subprocess.Popen([program, verb, *map(str, arguments)], env=environment, cwd=folder, stdout=subprocess.PIPE,
                                    stderr=subprocess.STDOUT, text=True)

        def end(verb, process):
            nonlocal failed
            output = process.communicate(timeout=120)[0]
            libraries = loaded(reports, verb.strip("-"))
            faults = []
            if process.returncode != 0:
                faults.append(f"status {process.returncode}\n{output}")
            if len(libraries) > MOST:
                faults.append(f"more than {MOST}: {' '.join(libraries)}")
            failed = failed or bool(faults) or not libraries
            print(f"{verb.strip('-'):8} {len(libraries):3} libraries{''.join('; ' + fault for fault in faults)}", flush=True)

        scene, log, endpoint = SCENES / "animation.x3dv", folder / "still.rlog", f"ipc://{folder}/mirror"
        for verb, *arguments in (["--version"], ["info", scene], ["info", SCENES / "mesh.x3dv"], ["run", scene, "--for", "0.2s"],
                                 ["record", scene, "-o", log, "--for", "0.2s"], ["replay", log, "--verify"]):
            end(verb, start(verb, *arguments))
        server = start("serve", scene, "--bind", endpoint, "--for", "3s")
        mirror = start("mirror", endpoint, "--for", "0.5s")
        end("mirror", mirror)
        end("serve", server)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
