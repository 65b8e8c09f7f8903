#!/usr/bin/env python3
"""Eight rules of CONTRIBUTING.md that a script can check, in every C++ file of the repository and in the change log.

Each .cpp opens with a comment: a sentence that says what is in it; each header with one of at most 15 lines. No function is longer
than 80 lines, from its first line to its closing brace. What sources of one program keep to themselves has names of its own, as builds
from nothing compile several sources at once. Who uses gmock's matchers or algorithms on ranges includes them, as builds without precompiled headers have no others.
What reaches the state of a scene is computed with the functions of rtsg/core/portable_math.h, not with those of the C library.
Tables that functions keep in core, documents, scripts and sync are neverDestroyed() (rtsg/core/never_destroyed.h), as threads read them until the process is gone.
What is under "Unreleased" in CHANGELOG.md are items of one line, of at most 120 characters.
Exit status 1 and a line for each file or function that breaks one.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).parent.parent
MOST, MOST_OPENING, MOST_ITEM = 80, 15, 120


def sources():
    """All files in C++ but those of builds, of what runs have left, and of other people."""
    for folder in sorted(path for path in ROOT.iterdir() if path.is_dir() and path.name[0] != "." and path.name != "out"):
        if not (folder / "CMakeCache.txt").exists():
            yield from sorted(str(path.relative_to(ROOT)) for path in folder.rglob("*") if path.suffix in (".cpp", ".h") and "node_modules" not in path.parts)


# Comments, strings and characters; raw strings first.
SKIPPED = re.compile(r'R"([^(\s]*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])+\'(?![\w])|//[^\n]*|/\*.*?\*/', re.DOTALL)
NO_FUNCTION = re.compile(r"^(?:if|for|while|switch|do|else|try|catch|return|namespace|class|struct|enum|union|extern)\b")
NAME = re.compile(r"((?:[A-Za-z_]\w*(?:<[^<>()]*>)?::)*(?:~?[A-Za-z_]\w*|operator\s*(?:\(\)|\S+?)))\s*\(")


def blank(match):
    """The same lines without what could hold braces."""
    text = match.group(0)
    return '""' + "\n" * text.count("\n") if text[0] in "R\"'" else "\n" * text.count("\n")


def functions(text):
    """(name, first line, lines) of each function that has a body, those inside of others (lambdas, local classes) not counted."""
    text = re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", lambda m: "\n" * m.group(0).count("\n"), SKIPPED.sub(blank, text), flags=re.M)
    stack = []  # (name or None, first line)
    head, start, line = "", 1, 1
    for c in text:
        if c == "\n":
            line += 1
        if c in ";{}":
            if c == "{":
                stripped = re.sub(r"^(?:public|private|protected)\s*:", "", head.strip()).strip()
                stripped = re.sub(r"^template\s*<[^{}]*?>\s*(?=[\w:\[~])", "", stripped)
                name = NAME.search(stripped) if "(" in stripped and not NO_FUNCTION.match(stripped) else None
                inside = any(entry[0] for entry in stack)
                before = stripped[:name.start()] if name else ""
                isInitializer = bool(stack) and stripped.endswith((",", "(", "=")) or "=" in before or "[" in before.replace("[[", "")
                stack.append((name.group(1) if name and not inside and not isInitializer else None, start))
            elif c == "}" and stack:
                name, first = stack.pop()
                if name:
                    yield name, first, line - first + 1
            head = ""
        else:
            if not head.strip() and not c.isspace():
                start, head = line, ""
            head += c


# What is defined at the left margin, as clang-format has it: types, then variables and functions.
DEFINED = re.compile(r"^(?:template <[^\n]*>\n)?(?:(?:struct|class|enum class|enum) (\w+)(?= [{:f])|using (\w+) = [^;]*|"
                     r"(?:[A-Za-z_][\w:<>,&*\[\] ]*?[&* ])(\w+)(?= ?[=({;\[]))", re.M)
PROGRAMS = ["app", "sync/web_module", "renderers/images/movie_module", "ogre/ogre_module", "bench"]
PROGRAMS += [f"tests/{folder.name}" for folder in (ROOT / "tests").iterdir() if folder.name != "fuzz" and list(folder.rglob("*.cpp"))]
IN_PLACE = {"auto", "bool", "char", "const", "double", "float", "int", "TEST", "TEST_F", "TEST_P", "INSTANTIATE_TEST_SUITE_P", "main"}
INSTEAD = {"verb_no_bench.cpp"}  # compiled where others are not


def own_names(text):
    """(name, what it stands for if it is an alias) of all that a source defines in anonymous namespaces."""
    text = SKIPPED.sub(blank, text)
    for body in re.findall(r"^namespace \{\n(.*?)^\}  $", text, re.M | re.S):
        body = re.sub(r"^(?:[ \t#][^\n]*)?\n", "", body, flags=re.M)  # what is inside of others
        for match in DEFINED.finditer(body):
            name = match.group(1) or match.group(2) or match.group(3)
            if name not in IN_PLACE and not match.group(0).startswith(("namespace", "using namespace", "TEST")):
                yield name, match.group(0) if match.group(2) else None


# Statics of functions that exit() would destroy.
PERISHING = re.compile(r"^ +static (?:const )?(?:std::(?:vector|map|set|string|unordered_\w+|function|unique_ptr|shared_ptr)\b[^&*;=({]* \w+(?: =|;|\{)"
                       r"|auto \w+ = (?:\[\]|std::make_))", re.M)
READ_BY_THREADS = ("core/", "documents/", "scripts/", "sync/")
# What precompiled headers bring, and builds without them do not; a source has it from its own header, too.
BROUGHT = {"<gmock/gmock.h>": re.compile(r"\b(?:EXPECT|ASSERT)_THAT\(|\btesting::(?:HasSubstr|ElementsAre|Not)\("),
           "<algorithm>": re.compile(r"\bstd::ranges::(?!size|data|begin|end|empty|distance|subrange|range|view|iota|[a-z_]*_range\b)[a-z_]+\(")}


def shared_names():
    for program in PROGRAMS:
        homes = {}
        pattern = "*.cpp" if program in ("app", "bench") else "**/*.cpp"
        for path in sorted((ROOT / program).glob(pattern)):
            for name, alias in set(own_names(path.read_text())) if path.name not in INSTEAD else ():
                other, meaning = homes.setdefault(name, (path, alias))
                if other != path and not (alias and alias == meaning):
                    yield f"{path.relative_to(ROOT)}: {name} is a name of {other.relative_to(ROOT)} too, which may be compiled with it"


# Folders whose results reach the state: readers, behaviours, scripts, what is picked or collides, and what sync encodes.
EXACT = ("core/", "documents/", "scripts/", "physics/", "dis/", "sync/", *(f"renderers/geometry/src/{room}/" for room in ("shapes", "tessellate", "flatten")))
ELEMENTARY = "sin|cos|tan|sincos|asin|acos|atan|atan2|sinh|cosh|tanh|asinh|acosh|atanh|exp|exp2|expm1|log|log2|log10|log1p|pow|cbrt|hypot"
LIBRARY = re.compile(r"\bstd::(?:(?:" + ELEMENTARY + r")[fl]?|polar|arg)\(|(?<![\w:.>])(?:" + ELEMENTARY + r")[fl]\(|\bglm::(?:" + ELEMENTARY +
                     r"|angleAxis|rotate|slerp|angle|axis|eulerAngles|pitch|yaw|roll|perspective)\(|\bstd::(?:" + ELEMENTARY + r")\b(?!\()")


def inexact(name, text):
    """What a source whose results reach the state takes from the C library."""
    if not name.startswith(EXACT):
        return
    for number, line in enumerate(SKIPPED.sub(blank, text).splitlines(), 1):
        if found := LIBRARY.search(line):
            yield f"{name}:{number}: {found[0].rstrip('(')} has other bits elsewhere: take rtsg/core/portable_math.h or rotation.h"


def changelog_items():
    """The faults of what is under "Unreleased"."""
    unreleased = False
    for number, line in enumerate((ROOT / "CHANGELOG.md").read_text().splitlines(), 1):
        if line.startswith("## "):
            unreleased = line == "## Unreleased"
        elif unreleased and line and not line.startswith(("- ", "### ")):
            yield f"CHANGELOG.md:{number}: is neither an item of one line nor the heading of an area"
        elif unreleased and len(line) > MOST_ITEM:
            yield f"CHANGELOG.md:{number}: the item has {len(line)} characters, more than {MOST_ITEM}"


def main():
    files = list(sources())
    problems, count = [f"tests/style.py: there is no {folder}" for folder in (*PROGRAMS, *EXACT) if not (ROOT / folder).is_dir()], 0
    for name in files:
        text = (ROOT / name).read_text()
        if name.endswith(".cpp") and not re.match(r"// \S", text):
            problems.append(f"{name}:1: does not open with a comment that says what is in it")
        opening = len(re.match(r"(?://[^\n]*\n)*", text)[0].splitlines())
        if name.endswith(".h") and not 1 <= opening <= MOST_OPENING:
            problems.append(f"{name}:1: opens with {opening} lines of comment, not 1 to {MOST_OPENING}")
        own = pathlib.Path(ROOT / name).with_suffix(".h")
        for header, uses in BROUGHT.items():
            if uses.search(text) and header not in text and not (own.exists() and header in own.read_text()):
                problems.append(f"{name}:1: {uses.search(text)[0]}…) without {header}")
        problems += inexact(name, text)
        for match in PERISHING.finditer(text) if name.startswith(READ_BY_THREADS) and "/src/" in name else ():
            problems.append(f"{name}:{text.count(chr(10), 0, match.start()) + 1}: a table that exit() destroys while threads may read it; see neverDestroyed()")
        for function, first, lines in functions(text):
            count += 1
            if lines > MOST:
                problems.append(f"{name}:{first}: {function} has {lines} lines, more than {MOST}")
    if count < 3000:
        problems.append(f"only {count} functions were found: this script does not see them")
    problems += shared_names()
    problems += changelog_items()
    print("\n".join(problems) if problems else f"{len(files)} files, {count} functions: none too long")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
