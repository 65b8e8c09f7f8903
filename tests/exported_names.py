#!/usr/bin/env python3
"""Does cmake/exported_names.py, which reads public headers by itself, find what a compiler finds in them?

usage: exported_names.py BUILD COMPILER...   (the first of the compilers that is a Clang of version 19 or newer, as it can say what it has read;
older ones do not know std::expected)

But for what macros declare, all functions, and variables with a place of their own, that Clang finds declared have to be found, and of what the build's static libraries
define for others no more. Exit status 1 and a line for each difference; 77 without
such a Clang or static libraries.
"""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

OLDEST = 19
ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "cmake"))
import exported_names  # noqa: E402
import libraries  # noqa: E402


def compiled(build, clang):
    """Paths of what the compiler finds declared below rtsg."""
    includes = [*(ROOT / folder / "include" for folder in libraries.FOLDERS), build / "core/generated"]
    headers = sorted(str(file.relative_to(folder)) for folder in includes for file in folder.glob("rtsg/*/*.h"))
    with tempfile.NamedTemporaryFile("w", suffix=".cpp") as source:
        source.write("".join(f"#include <{header}>\n" for header in headers))
        source.flush()
        dump = subprocess.run([clang, "-std=c++23", '-DRTSG_PLUGIN_VERSION=""', *(f"-I{folder}" for folder in includes), "-fsyntax-only",
                               "-Xclang", "-ast-dump=json", "-Xclang", "-ast-dump-filter=rtsg::", source.name], capture_output=True, text=True, check=True).stdout
    mangled = sorted(set(re.findall(r'"mangledName": "(_ZN[^"]*)"', dump)))
    shown = subprocess.run(["c++filt"], input="\n".join(mangled), capture_output=True, text=True, check=True).stdout.splitlines()
    return {exported_names.path(name): name for name in shown if not name.startswith("_Z")}


def version(compiler):
    """The major version of a Clang; 0 for what is none, or not there."""
    if not shutil.which(compiler):
        return 0
    said = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=False).stdout
    found = re.search(r"clang version (\d+)", said)
    return int(found[1]) if found else 0


def main():
    build = pathlib.Path(sys.argv[1])
    clang = next((compiler for compiler in sys.argv[2:] if version(compiler) >= OLDEST), None)
    archives = [line.partition(" ")[2] for line in (build / "exports.txt").read_text().splitlines() if re.match(r"library .*\.a$", line)]
    if not clang or not archives:
        print("skipped:", "no static libraries" if clang else f"no Clang of version {OLDEST} or newer among {', '.join(sys.argv[2:])}")
        return 77
    api, truth = exported_names.declared(build), compiled(build, clang)
    faults = [f"not found: {name}" for name in truth.values() if not api.has(name) and not name.startswith("rtsg::FieldTypeOf<") and "{lambda(" not in name]
    strong = [(line.split()[-1]) for line in subprocess.run(["nm", "-g", "--defined-only", *archives], capture_output=True, text=True, check=True).stdout.splitlines()
              if re.search(r" [TDBR] _Z", line)]
    shown = subprocess.run(["c++filt"], input="\n".join(strong), capture_output=True, text=True, check=True).stdout.splitlines()
    faults += [f"found in vain: {name}" for name in shown if api.has(name) and exported_names.path(name) not in truth]
    print("\n".join([*faults, f"{len(truth)} names of {clang}, {len(strong)} of libraries, {len(faults)} faults"]))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
