#!/usr/bin/env python3
"""Committed logs, which every build has to verify, and to get by running their scenes again.

usage: logs.py --program RTSG [--record] [NAME ...]

The logs lie beside this script, with the scenes that they are of. Each is replayed with every state's hash checked; what kept its inputs is run again,
too, and each of its states has to have the recorded bits, whatever compiler, C library and processor there are. --record writes them anew:
where a scene does something else on purpose, or where the format is another. Then what an earlier version wrote stays, too, under its own name.
"""
import argparse
import pathlib
import subprocess
import sys

FOLDER = pathlib.Path(__file__).resolve().parent
MOST_BYTES = 1_000_000
SENT = {
    "animation": ["AIM.set_destination=0.6 0 0.8 2.5@0.4", "STEP.set_destination=3.7@0.2", "STEP.set_destination=-1.1@0.55", "CLOCK.cycleInterval=1.1@1.2"],
    "scripts": ["SUM.set_pitch=0.83@0.5", "SUM.set_pitch=1.21@1.3"],
    "mesh": ["CLOCK.enabled=FALSE@0.9", "CLOCK.enabled=TRUE@1.2"],
}
LOGS = {  # name: the scene, how it is recorded (None: by an earlier build, once and for all), and whether it can be run again
    "animation_state": ("animation", ["--inputs"], True),
    "animation_compact": ("animation", ["--inputs", "--coding", "compact", "--keyframe-bytes", "8000"], True),
    "animation_input": ("animation", ["--mode", "input"], True),
    "animation_input_fewer_types": ("animation", None, True),
    "animation_lossy": ("animation", ["--mode", "lossy", "--error", "0.01"], False),
    "scripts_state": ("scripts", ["--inputs", "--coding", "smallest"], True),
    "scripts_input": ("scripts", ["--mode", "input"], True),
    "scripts_input_fewer_types": ("scripts", None, True),
    "mesh_state": ("mesh", ["--inputs", "--coding", "smallest"], True),
    "mesh_input": ("mesh", ["--mode", "input"], True),
    "mesh_input_fewer_types": ("mesh", None, True),
    "mesh_lossy": ("mesh", ["--mode", "lossy", "--coding", "smallest", "--error", "0.005"], False),
}


def run(arguments):
    """Whether it went well; what it said otherwise."""
    done = subprocess.run(arguments, capture_output=True, text=True, timeout=120, cwd=FOLDER)
    if done.returncode != 0:
        print(f"FAILED with status {done.returncode}: {' '.join(map(str, arguments))}\n{done.stdout}{done.stderr}")
    return done.returncode == 0


def record(program, name):
    scene, options, _ = LOGS[name]
    given = [word for event in SENT[scene] for word in ("--set", event)]
    return run([program, "record", f"{scene}.x3dv", "-o", f"{name}.rlog", "--for", "2s", "--fps", "24", "--force", *options, *given])


def check(program, name):
    scene, _, again = LOGS[name]
    whole = run([program, "replay", f"{name}.rlog", "--verify"])
    return (not again or run([program, "replay", f"{name}.rlog", "--rerun", f"{scene}.x3dv"])) and whole


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", required=True, type=lambda path: str(pathlib.Path(path).resolve()))
    parser.add_argument("--record", action="store_true")
    parser.add_argument("names", nargs="*", metavar="NAME")
    arguments = parser.parse_args()
    names = arguments.names or [name for name in LOGS if not arguments.record or LOGS[name][1] is not None]
    if unknown := [name for name in names if name not in LOGS]:
        parser.error(f"there is no log {unknown[0]}, only {', '.join(LOGS)}")
    if arguments.record and (kept := [name for name in names if LOGS[name][1] is None]):
        parser.error(f"{kept[0]} is what an earlier build wrote: it is not recorded anew")
    done = [(record if arguments.record else check)(arguments.program, name) for name in names]
    files = sorted(FOLDER.glob("*.rlog"))
    size = sum(path.stat().st_size for path in files)
    wrong = [f"{path.name} is not in this script" for path in files if path.stem not in LOGS]
    if size > MOST_BYTES:
        wrong.append(f"the logs have {size} bytes together, more than {MOST_BYTES}")
    print("\n".join([f"{sum(done)} of {len(done)} logs went well; all have {size} bytes", *wrong]))
    return 0 if all(done) and not wrong else 1


if __name__ == "__main__":
    sys.exit(main())
