#!/usr/bin/env python3
"""Words that names of the C++ sources may not have, because docs/glossary.md has the field's word for what they meant.

A name is divided at capitals, digits and underscores: kMostTurns has k, most and turns. Names of tests are sentences and may have any word; so
may names of X3D nodes and fields, comments and strings. ALLOWED has the uses that stay, each with its reason. Every folder of C++ is read.
Exit status 1 and a line for each name and file that breaks the rule, and for each permission that nobody needs.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).parent.parent
INSTEAD = {
    "place": "position, location, transform, endpoint, index", "places": "positions, locations, transforms", "way": "path, displacement, direction",
    "ways": "paths", "told": "reported", "tell": "report, notify, send", "tells": "reports", "made": "created, built", "turn": "rotation, angle, round, phase",
    "turns": "rotations", "share": "fraction, weight, part", "shares": "fractions, weights, parts", "thing": "item, object, node", "things": "items, objects",
    "most": "maximum, max", "least": "minimum, min", "crew": "team", "lasting": "neverDestroyed"}
ALLOWED = {
    "atMost": "a bound, as in at most", "atLeast": "a bound, as in at least", "atLeastZero": "a bound", "bentPastAtMost": "a bound",
    "inPlace": "without a copy", "in_place": "of std", "moveIntoPlace": "a file that gets its name", "tell": "libsndfile's member", "kFullTurn": "an angle of 2 pi",
    "kHalfTurn": "an angle of pi", "turnAngle": "the angle by which an outline turns at a vertex", "turnLock": "a lock that is taken in turn",
    "ShareNodes": "the filter `share`", "makeShareNodes": "the filter `share`", "shareFace": "two edges have a face in common"}

# Comments, includes, strings and characters; raw strings first.
SKIPPED = re.compile(r'R"([^(\s]*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])+\'(?![\w])|//(?:[^\n\\]|\\.)*|/\*.*?\*/|^[ \t]*#[ \t]*include[^\n]*',
                     re.DOTALL | re.M)
TEST = re.compile(r"\b(TEST|TEST_F|TEST_P|TYPED_TEST|INSTANTIATE_TEST_SUITE_P)\(\s*(\w+),\s*(\w+)")
NAME = re.compile(r"[A-Za-z_]\w*")
PART = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


def words(name):
    return [part.lower() for part in PART.findall(name)]


def sources(root):
    for path in sorted(root.rglob("*")):
        parts = path.relative_to(root).parts
        if path.suffix in (".cpp", ".h") and not parts[0].startswith(("build", ".", "out")) and "node_modules" not in parts:
            yield path


def test_name(match):
    """The macro without what is a sentence: the name of the test, and that of a suite which is no class."""
    return f"{match[1]}({'' if match[1] == 'TEST' else match[2]}"


def main():
    tables = "\n".join(path.read_text() for path in sorted(ROOT.rglob("*.x3dspec")) if "build" not in path.relative_to(ROOT).parts)
    fields = set(NAME.findall(tables))
    faults, used, count = [], set(), 0
    for path in sources(ROOT):
        text = SKIPPED.sub(" ", path.read_text())
        names = set(NAME.findall(TEST.sub(test_name, text)))
        count += len(names)
        for name in sorted(names):
            found = [word for word in words(name) if word in INSTEAD]
            if not found:
                continue
            if name in ALLOWED:
                used.add(name)
            elif name not in fields or name in INSTEAD:
                faults.append(f"{path.relative_to(ROOT)}: {name}: say {INSTEAD[found[0]]} (docs/glossary.md)")
        stem = [word for word in words(path.stem) if word in INSTEAD]
        if stem and path.stem != "filter_share":
            faults.append(f"{path.relative_to(ROOT)}: the file's name: say {INSTEAD[stem[0]]} (docs/glossary.md)")
    faults += [f"tests/words.py: nothing is named {name}, which ALLOWED has" for name in sorted(ALLOWED.keys() - used)]
    if count < 50000:
        faults.append(f"only {count} names were found: this script does not see them")
    print("\n".join(faults) or f"{count} names")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
