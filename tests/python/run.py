#!/usr/bin/env python3
"""Runs one file of the Python package's tests by pytest; status 77, with the reason, where that cannot be."""
import argparse
import importlib.util
import os
import subprocess
import sys
import tempfile


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", nargs="?")
    parser.add_argument("--package", help="the folder that holds the package")
    parser.add_argument("--missing", default="", help="what the build lacked")
    arguments = parser.parse_args()
    lacks = [name for name in ("numpy", "pytest") if importlib.util.find_spec(name) is None]
    reason = (f"the package was not built: it needs {arguments.missing}" if arguments.missing
              else f"needs python3-{' and python3-'.join(lacks)}" if lacks else "")
    if reason:
        print(f"SKIPPED: {reason}")
        return 77
    environment = dict(os.environ, PYTHONPATH=arguments.package, PYTHONDONTWRITEBYTECODE="1")
    with tempfile.TemporaryDirectory() as folder:
        return subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--basetemp={folder}/t",
                               os.path.abspath(arguments.file)], env=environment, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
