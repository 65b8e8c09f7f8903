#!/usr/bin/env python3
"""Do programs, libraries and modules look for libraries only where they were built or installed?

usage: run_paths.py BUILD CMAKE

Reads RUNPATH and RPATH of all ELF files of the build folder BUILD, and of what CMAKE installs from it, the Python package too. An item begins with
$ORIGIN, or is a folder by its whole path; of what is installed, none leads into the build. Empty and relative items would make whoever fills the
working folder run code. Then the program is run in a folder of files that have the names of all libraries that these files need, and hold no
libraries. Exit status 1 and a line for each fault.
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile


def dynamic(file):
    """The items of its search paths, and the libraries that it needs; None: it is no ELF file."""
    with open(file, "rb") as opened:
        if opened.read(4) != b"\x7fELF":
            return None
    listed = subprocess.run(["readelf", "-d", file], capture_output=True, text=True, check=False, env={**os.environ, "LC_ALL": "C"}).stdout
    paths = re.findall(r"\((?:RUNPATH|RPATH)\).*\[(.*)\]", listed)
    return [item for path in paths for item in path.split(":")], re.findall(r"\(NEEDED\).*\[(.*)\]", listed)


def elf_files(folder):
    for place, folders, files in os.walk(folder):
        # Objects, and other tests' scratch.
        folders[:] = [name for name in folders if name not in ("CMakeFiles", "install", "Testing")]
        for name in files:
            file = pathlib.Path(place) / name
            if not file.is_symlink() and file.is_file() and (found := dynamic(file)):
                yield file, *found


def main():
    build, cmake = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2]
    faults, needed, counted = [], set(), {"built": 0, "installed": 0}
    with tempfile.TemporaryDirectory() as name:
        scratch = pathlib.Path(name)
        for more in ([], ["--component", "python"]):
            subprocess.run([cmake, "--install", build, "--prefix", "/usr", *more], check=True, stdout=subprocess.DEVNULL,
                           env={**os.environ, "DESTDIR": str(scratch / "tree")})
        for kind, folder in (("built", build), ("installed", scratch / "tree")):
            for file, items, libraries in elf_files(folder):
                counted[kind] += 1
                needed.update(libraries)
                shown = file.relative_to(folder)
                for item in items:
                    if not re.match(r"(\$ORIGIN|\$\{ORIGIN\}|)(/|$)", item) or not item:
                        faults.append(f"{kind} {shown}: item '{item}' is looked for in the working folder")
                    elif kind == "installed" and pathlib.Path(item).is_relative_to(build):
                        faults.append(f"{kind} {shown}: item '{item}' leads into the build")
        # A loader that finds one of these here says that its header is too short.
        here = scratch / "here"
        here.mkdir()
        own = [path.name for path in build.glob("librtsg_*.so")]
        for library in [*needed, *own]:
            (here / library).write_text("no library")
        environment = {key: value for key, value in os.environ.items() if key != "LD_LIBRARY_PATH"}
        for program in (build / "rtsg", scratch / "tree/usr/bin/rtsg"):
            ran = subprocess.run([program, "--version", "--json"], capture_output=True, text=True, check=False, cwd=here, env=environment)
            if ran.returncode != 0 or (own and '"modules":{' not in ran.stdout):
                faults.append(f"{program}: status {ran.returncode} in a folder of files with libraries' names\n{ran.stderr}")
            faults += [f"{program}: module {module} is not found there" for module in re.findall(r'"(\w+)":false', re.search(r'"modules":\{[^}]*', ran.stdout + '"modules":{').group())
                       if (build / f"librtsg_{module}.so").exists()]
    print("\n".join([*faults, f"{counted['built']} built and {counted['installed']} installed files, {len(needed)} libraries, {len(faults)} faults"]))
    return 1 if faults or min(counted.values()) < 2 else 0


if __name__ == "__main__":
    sys.exit(main())
