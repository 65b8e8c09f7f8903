#!/usr/bin/env python3
"""Is every module of a build in a package, and is what there is to install named in its page?

usage: packages.py BUILD

Each module that BUILD/exports.txt names is in one of debian/*.install, and each that is there has a call in CMake that makes it. Packages of
debian/control, and libraries, which are components of find_package(), stand in docs/installing.md. Exit status 1 and a line for each fault.
"""
import collections
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "cmake"))
import libraries  # noqa: E402


def main():
    exports = (pathlib.Path(sys.argv[1]) / "exports.txt").read_text()
    modules = set(re.findall(r"^module .*/librtsg_(\w+)\.so$", exports, re.M))
    components = re.findall(r"^library .*/librtsg_(\w+)\.", exports, re.M)
    installed = collections.defaultdict(list)
    for file in sorted((ROOT / "debian").glob("*.install")):
        for name in re.findall(r"^usr/lib/\*/rtsg/librtsg_(\w+)\.so$", file.read_text(), re.M):
            installed[name].append(file.name)
    calls = re.compile(r"^\s*rtsg_(?:optional_module|module|delay_load)\((\w+)", re.M)
    made = {name for folder in libraries.FOLDERS for name in calls.findall((ROOT / folder / "CMakeLists.txt").read_text())}
    faults = [f"module {name}: in no package (debian/*.install)" for name in sorted(modules - set(installed))]
    faults += [f"module {name}: in {' and '.join(files)}" for name, files in installed.items() if len(files) > 1]
    faults += [f"{installed[name][0]}: nothing makes librtsg_{name}.so" for name in sorted(set(installed) - made)]
    page = (ROOT / "docs/installing.md").read_text()
    packages = re.findall(r"^Package: (\S+)", (ROOT / "debian/control").read_text(), re.M)
    faults += [f"docs/installing.md: nothing of {what} {name}" for what, names in (("package", packages), ("component", components))
               for name in names if f"`{name}`" not in page]
    print("\n".join([*faults, f"{len(modules)} modules, {len(packages)} packages, {len(components)} components, {len(faults)} faults"]))
    return 1 if faults or not modules or not packages else 0


if __name__ == "__main__":
    sys.exit(main())
