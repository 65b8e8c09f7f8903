#!/usr/bin/env python3
"""Completion as a person meets it: zsh and fish themselves are asked what follows a half-typed line.

usage: completion.py --program RTSG
Exit status 77 (skipped) if neither shell is installed; one that is missing is named.
"""
import argparse
import os
import pathlib
import pty
import select
import shutil
import subprocess
import sys
import tempfile
import time

# A line that is typed, and what it becomes.
LINES = [
    ("rtsg ren", "rtsg render "),
    ("rtsg render a.x3dv --integ", "rtsg render a.x3dv --integrator "),
    ("rtsg render a.x3dv --integrator pa", "rtsg render a.x3dv --integrator path "),
    ("rtsg completion z", "rtsg completion zsh "),
    ("rtsg help rep", "rtsg help replay "),
    ("rtsg render sce", "rtsg render scene.x3dv "),
]
PATIENCE = 60  # seconds; only a failing test waits this long


def environment(folder):
    return {**os.environ, "HOME": str(folder), "PATH": f"{folder}/bin:{os.environ['PATH']}", "TERM": "dumb"}


def fish(program, folder):
    script = folder / "rtsg.fish"
    script.write_bytes(subprocess.run([program, "completion", "fish"], check=True, stdout=subprocess.PIPE).stdout)
    wrong = []
    for typed, whole in LINES:
        said = subprocess.run(["fish", "--no-config", "-c", f"source {script}; complete -C '{typed}'"], cwd=folder,
                              env=environment(folder), capture_output=True, text=True, timeout=PATIENCE)
        offered = [line.split("\t")[0] for line in said.stdout.splitlines()]
        if offered != [whole.split()[-1]] or said.stderr:
            wrong.append(f"fish: {typed!r} offers {offered}, not {whole.split()[-1]!r} alone {said.stderr}")
    return wrong


def zsh(program, folder):
    """Types into an interactive shell; a key of the test's own writes down what the line has become."""
    (folder / "_rtsg").write_bytes(subprocess.run([program, "completion", "zsh"], check=True, stdout=subprocess.PIPE).stdout)
    result = folder / "lines"
    pid, terminal = pty.fork()
    if pid == 0:
        os.chdir(folder)
        os.execvpe("zsh", ["zsh", "-f", "-i"], environment(folder))
    os.write(terminal, (f"fpath=({folder} $fpath); autoload -Uz compinit; compinit -u -D; "
                        f"note() {{ print -r -- \"$BUFFER|\" >> {result}; BUFFER= }}; zle -N note; bindkey '^X' note; "
                        f": > {result}\n").encode())
    sent, until = 0, time.monotonic() + PATIENCE
    while time.monotonic() < until:
        ready, _, _ = select.select([terminal], [], [], 0.05)
        if ready:
            os.read(terminal, 65536)
        there = result.read_text().splitlines() if result.exists() else None
        if there is not None and len(there) == len(LINES):
            break
        if there is not None and sent == len(there):  # the line before has been noted
            os.write(terminal, (LINES[sent][0] + "\t\x18").encode())
            sent += 1
    os.kill(pid, 9)
    os.waitpid(pid, 0)
    became = [line.rstrip("|") for line in result.read_text().splitlines()] if result.exists() else []
    became += ["nothing"] * (len(LINES) - len(became))
    return [f"zsh: {typed!r} became {line!r}, not {whole!r}" for (typed, whole), line in zip(LINES, became) if line != whole]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", required=True, type=pathlib.Path)
    program = parser.parse_args().program.resolve()
    shells = {"zsh": zsh, "fish": fish}
    there = [name for name in shells if shutil.which(name)]
    for name in shells:
        if name not in there:
            print(f"SKIPPED: {name} is not installed")
    if not there:
        return 77
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name).resolve()
        (folder / "bin").mkdir()
        (folder / "bin" / "rtsg").symlink_to(program)
        (folder / "scene.x3dv").write_text("#X3D V4.0 utf8\nPROFILE Full\n")
        wrong = [line for shell in there for line in shells[shell](program, folder)]
    print("\n".join(wrong) if wrong else f"{len(LINES)} lines completed in {' and '.join(there)}")
    return 1 if wrong else 0


sys.exit(main())
