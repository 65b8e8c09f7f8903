#!/usr/bin/env python3
"""Does every option of `rtsg` stand in a page?

Takes the options that `rtsg VERB --help` lists, for each verb that `rtsg --help` names, and looks for each name as a whole word in
README.md, docs/*.md and sync/PROTOCOL.md. An option with a short and a long name may stand there by either. Exit status 1, and a line
with verb and option for each that is nowhere.
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), ROOT / "sync/PROTOCOL.md"]
NAME = r"-{1,2}[a-zA-Z][\w-]*"
LEAST = 200  # options of all verbs together


def help_of(program, *verb):
    return subprocess.run([program, *verb, "--help"], capture_output=True, text=True, check=True).stdout


def options(text):
    """The names of each option, as a line of --help begins with them: "-o,--output TEXT ..."."""
    for line in text.splitlines():
        names = re.match(rf"  ({NAME}(?:, ?{NAME})*)(?=\s|$)", line)
        if names:
            yield re.split(", ?", names[1])


def main():
    program = sys.argv[1]
    written = set()
    for page in PAGES:
        written.update(re.findall(rf"(?<![\w-]){NAME}", page.read_text()))
    listed = help_of(program)
    verbs = re.findall(r"^  ([a-z]+) ", listed[listed.lower().index("subcommands"):], re.MULTILINE)
    missing, count = [], 0
    for verb in verbs:
        for names in options(help_of(program, verb)):
            count += 1
            if not written.intersection(names):
                missing.append(f"rtsg {verb}: {', '.join(names)} stands in no page")
    if count < LEAST:
        missing.append(f"only {count} options were found: this script does not see them")
    print("\n".join(missing) if missing else f"{len(verbs)} verbs, {count} options: each stands in a page")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
