#!/usr/bin/env python3
"""The number of the plug-ins' interface is another one with each declaration that is another one, and the same whatever comments say."""
import argparse
import pathlib
import subprocess
import sys
import tempfile

HEADERS = {"a.h": "#pragma once\n// A pair.\nstruct A {\n    int first;  // metres\n    int second;\n};\n", "b.h": "void use(const char* = \"a;b\");\n"}
EQUAL = [("a.h", "// A pair.\n", ""), ("a.h", "metres", "feet; [and] more"), ("a.h", "int first;", "int   first;")]
OTHER = [("a.h", "int second", "long second"), ("a.h", "int second;", ""), ("b.h", "a;b", "a;c"), ("b.h", "void", "int")]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--cmake", default="cmake")
    cmake = parser.parse_args().cmake
    script = pathlib.Path(__file__).resolve().parents[2] / "cmake" / "plugin_interface.cmake"

    def number(name=None, old="", new=""):
        with tempfile.TemporaryDirectory() as made:
            folder = pathlib.Path(made)
            for header, text in HEADERS.items():
                assert header != name or old in text
                (folder / header).write_text(text.replace(old, new) if header == name else text)
            files = ";".join(str(folder / header) for header in HEADERS)
            subprocess.run([cmake, f"-DHEADERS={files}", "-DVERSION=1.2", f"-DOUTPUT={folder / 'out.h'}", "-P", script], check=True)
            return (folder / "out.h").read_text()

    first = number()
    failures = [f"{change} makes it {number(*change)}" for change in EQUAL if number(*change) != first]
    failures += [f"{change} leaves it as it was" for change in OTHER if number(*change) == first]
    if '"1.2-' not in first:
        failures.append(f"it does not begin with the version: {first}")
    print("\n".join(failures) or "ok")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
