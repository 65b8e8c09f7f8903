#!/usr/bin/env python3
"""Do the shared libraries and the modules of a build export what they should, and nothing else?

usage: exported_symbols.py BUILD [MODULE...]   (default: all modules in BUILD)

A library exports names of the namespace rtsg, with their types' tables, and functions that begin with rtsg_; none of them stands for a
function of somebody else's library. A module exports names that begin with rtsg, by which it is entered. Exit status 1 and a line for each fault.
"""
import pathlib
import re
import subprocess
import sys

OURS = re.compile(r"^(?:(?:vtable|typeinfo|typeinfo name|VTT|guard variable|TLS init function|TLS wrapper function) for "
                  r"|(?:non-)?virtual thunk to |covariant return thunk to )?(?:.*\s)?\(?(?:rtsg::|rtsg_)")


def exported(file):
    """(name, name as people write it)"""
    listed = [subprocess.run(["nm", "-D", "--defined-only", *how, file], capture_output=True, text=True, check=True).stdout for how in ([], ["-C"])]
    return [(raw.split(" ", 2)[2], shown.split(" ", 2)[2]) for raw, shown in zip(*(text.splitlines() for text in listed))]


def main():
    build = pathlib.Path(sys.argv[1])
    faults, count = [], 0
    libraries = [file for file in build.glob("*/librtsg_*.so.*") if not file.is_symlink()]
    for library in libraries:
        for raw, shown in exported(library):
            count += 1
            # A template of another library with one of our types as argument is not exported
            # either.
            if not re.match(r"_Z(N|NK|NKR|NO|TV|TI|TS|TT|GV|GVZ|Z|Th|Tv|TH|TW)?.*4rtsg|rtsg_", raw) or not OURS.match(shown):
                faults.append(f"{library.name}: {shown}")
    modules = [pathlib.Path(name) for name in sys.argv[2:]] or sorted(build.glob("librtsg_*.so"))
    for module in modules:
        names = exported(module)
        count += len(names)
        faults += [f"{module.name}: {shown}" for raw, shown in names if not raw.startswith("rtsg")]
        if not names:
            faults.append(f"{module.name}: nothing")
    print("\n".join(faults + [f"{len(libraries)} libraries, {len(modules)} modules, {count} symbols, {len(faults)} faults"]))
    return 1 if faults or not modules else 0


if __name__ == "__main__":
    sys.exit(main())
