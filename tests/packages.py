#!/usr/bin/env python3
"""Is every library and module of a build in one package, and is what there is to install named in its page?

usage: packages.py BUILD

Each module and library that BUILD/exports.txt names is in one of debian/*.install, and each module there has a call in CMake that makes it. Each
package of a module depends on that of the library which loads it. Packages of debian/control, and libraries, which are components of
find_package(), stand in docs/installing.md. Exit status 1 and a line for each fault.
"""
import collections
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "cmake"))
import libraries  # noqa: E402


def dependencies(control):
    """Of each package those of the same version that it brings, directly or not."""
    direct = {}
    for block in re.findall(r"^Package: (\S+)\n((?:.+\n)+)", control, re.M):
        said = re.search(r"^Depends:((?:.*\n)(?: .*\n)*)", block[1], re.M)
        direct[block[0]] = set(re.findall(r"(\S+) \(= \$\{binary:Version\}\)", said[1] if said else ""))
    whole = {}
    for name in direct:
        seen, ahead = set(), list(direct[name])
        while ahead:
            if (next_one := ahead.pop()) not in seen:
                seen.add(next_one)
                ahead += direct.get(next_one, ())
        whole[name] = seen
    return whole


def main():
    exports = (pathlib.Path(sys.argv[1]) / "exports.txt").read_text()
    modules = set(re.findall(r"^module .*/librtsg_(\w+)\.so$", exports, re.M))
    components = re.findall(r"^library .*/librtsg_(\w+)\.", exports, re.M)
    installed, holders = collections.defaultdict(list), collections.defaultdict(list)
    for file in sorted((ROOT / "debian").glob("*.install")):
        for name in re.findall(r"^usr/lib/\*/rtsg/librtsg_(\w+)\.so$", file.read_text(), re.M):
            installed[name].append(file.name.removesuffix(".install"))
        for name in re.findall(r"^usr/lib/\*/librtsg_(\w+)\.so\.\*$", file.read_text(), re.M):
            holders[name].append(file.name.removesuffix(".install"))
    calls = re.compile(r"^\s*rtsg_(?:optional_module|module|delay_load)\((\w+)\s+FOR\s+(\w+)", re.M)
    made = {name: user for folder in libraries.FOLDERS for name, user in calls.findall((ROOT / folder / "CMakeLists.txt").read_text())}
    faults = [f"module {name}: in no package (debian/*.install)" for name in sorted(modules - set(installed))]
    faults += [f"library {name}: in no package (debian/*.install)" for name in components if name not in holders]
    faults += [f"{name}: in {' and '.join(files)}" for name, files in [*installed.items(), *holders.items()] if len(files) > 1]
    faults += [f"{installed[name][0]}: nothing makes librtsg_{name}.so" for name in sorted(set(installed) - set(made))]
    needs = dependencies((ROOT / "debian/control").read_text())
    faults += [f"{files[0]} has librtsg_{name}.so for {made[name]}, and does not depend on {holders[made[name]][0]}"
               for name, files in installed.items() if name in made and made[name] in holders
               and holders[made[name]][0] not in needs.get(files[0], set()) | {files[0]}]
    page = (ROOT / "docs/installing.md").read_text()
    packages = re.findall(r"^Package: (\S+)", (ROOT / "debian/control").read_text(), re.M)
    faults += [f"docs/installing.md: nothing of {what} {name}" for what, names in (("package", packages), ("component", components))
               for name in names if f"`{name}`" not in page]
    print("\n".join([*faults, f"{len(modules)} modules, {len(packages)} packages, {len(components)} components, {len(faults)} faults"]))
    return 1 if faults or not modules or not packages else 0


if __name__ == "__main__":
    sys.exit(main())
