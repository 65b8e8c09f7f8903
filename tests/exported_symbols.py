#!/usr/bin/env python3
"""Do the libraries and the modules of a build export what they should, and nothing else?

usage: exported_symbols.py BUILD

Of a shared library the exported names are those that public headers declare, with the version RTSG_<VERSION>, and those that cmake/insides.txt
lists, with RTSG_<VERSION>_PRIVATE. Libraries and programs of a static build need no others of each other, and all that are listed, so that
a shared one links. A module exports names that begin with rtsg, by which it is entered. BUILD/exports.txt says what the build has: other
files in its folder are left from earlier ones. Exit status 1 and a line for each fault.
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "cmake"))
import exported_names  # noqa: E402


def undefined(files):
    listed = subprocess.run(["nm", "-p", "-u", *files], capture_output=True, text=True, check=True).stdout
    return {line.split()[-1] for line in listed.splitlines() if re.match(r"\s+U ", line)}


def exported(library, api, insides):
    """Faults of a shared library, and the count of its names with each kind of version."""
    faults, counts = [], [0, 0]
    for raw, shown in exported_names.defined("nm", [library], "-D"):
        name, _, version = shown.partition("@@")
        if name.startswith("RTSG_"):  # the version itself
            continue
        isPrivate = version.endswith("_PRIVATE")
        counts[isPrivate] += 1
        if not re.fullmatch(r"RTSG_[\d.]+(_PRIVATE)?", version):
            faults.append(f"{library.name}: {shown} has no version of ours")
        elif isPrivate == api.has(name) or isPrivate and not insides.line(name):
            faults.append(f"{library.name}: {shown}")
    return faults, counts


def needed(libraries, users, api, insides):
    """Faults of static libraries: what others need of their insides and is not listed, and what is listed in vain."""
    owner = {}
    for library in libraries:
        for raw, shown in exported_names.defined("nm", [library], "-g"):
            owner.setdefault(raw, []).append((library, shown))
    faults, used = [], set()
    for files in [*([library] for library in libraries), users]:
        for raw in undefined(files):
            for library, shown in owner.get(raw, []):
                if library in files or api.has(shown):
                    continue
                used.add(insides.line(shown))
                if not insides.line(shown):
                    faults.append(f"{library.name}: {shown} is needed elsewhere, and neither in a public header nor in cmake/insides.txt")
    return faults + [f"cmake/insides.txt: nobody needs {line}" for line in insides.lines.values() if line not in used]


def main():
    build = pathlib.Path(sys.argv[1])
    has = {"insides": [], "module": [], "library": [], "user": []}
    for line in (build / "exports.txt").read_text().splitlines():
        kind, _, file = line.partition(" ")
        if not file.endswith(".gch"):  # an object to CMake, when sources are compiled with it
            has[kind].append(pathlib.Path(file))
    api, insides = exported_names.declared(build), exported_names.Insides(has["insides"][0])
    faults, counts = [], [0, 0]
    shared = [library for library in has["library"] if library.suffix != ".a"]
    for library in shared:
        found, counted = exported(library, api, insides)
        faults += found
        counts = [a + b for a, b in zip(counts, counted)]
    if not shared:
        faults += needed(has["library"], has["user"], api, insides)
    for module in has["module"]:
        names = exported_names.defined("nm", [module], "-D")
        faults += [f"{module.name}: {shown}" for raw, shown in names if not raw.startswith("rtsg")]
        if not names:
            faults.append(f"{module.name}: nothing")
    print("\n".join([*faults, f"{len(has['library'])} libraries ({counts[0]} names of public headers exported, {counts[1]} others), {len(has['module'])} modules, {len(faults)} faults"]))
    return 1 if faults or not has["module"] else 0


if __name__ == "__main__":
    sys.exit(main())
