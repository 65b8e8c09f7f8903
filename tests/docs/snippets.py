#!/usr/bin/env python3
"""Is the code in the docs that which is compiled and run?

A fenced block below a line `<!-- from FILE -->` must consist of lines of FILE, in their order; lines may be left out,
and indentation does not count. Exit status 1 and a line for each that is not there.
"""
import pathlib
import re
import sys


def check(root):
    wrong, blocks = [], 0
    for doc in [root / "README.md", *sorted((root / "docs").glob("*.md"))]:
        pattern = r"<!-- from (\S+) -->\s*\n```\w*\n(.*?)\n```"
        for match in re.finditer(pattern, doc.read_text(), re.S):
            blocks += 1
            source = iter([line.strip() for line in (root / match.group(1)).read_text().splitlines()])
            for line in match.group(2).splitlines():
                if line.strip() and line.strip() not in source:
                    wrong.append(f"{doc.relative_to(root)}: not in {match.group(1)}, or not there: {line.strip()}")
                    break
    return wrong, blocks


def main():
    wrong, blocks = check(pathlib.Path(__file__).resolve().parents[2])
    for line in wrong:
        print(line)
    print(f"{blocks} blocks of code, {len(wrong)} wrong")
    sys.exit(1 if wrong or blocks < 2 else 0)


if __name__ == "__main__":
    main()
