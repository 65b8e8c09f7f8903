#!/usr/bin/env python3
"""Is the code in the docs that which is compiled and run?

A fenced block below a line `<!-- from FILE -->` must consist of lines of FILE, in their order; lines may be left out,
and indentation does not count. Every block of C++ has such a line. Exit status 1 and a line for each that is not there.
"""
import pathlib
import re
import sys


def check(root):
    wrong, blocks = [], 0
    for doc in [root / "README.md", *sorted((root / "docs").glob("*.md"))]:
        text = doc.read_text()
        for match in re.finditer(r"(.*)\n```cpp\n(.*)", text):
            if not re.fullmatch(r"<!-- from (\S+) -->", match.group(1).strip()):
                wrong.append(f"{doc.relative_to(root)}: nobody compiles the block that begins: {match.group(2)}")
        pattern = r"<!-- from (\S+) -->\s*\n```\w*\n(.*?)\n```"
        for match in re.finditer(pattern, text, re.S):
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
    sys.exit(1 if wrong or blocks < 5 else 0)


if __name__ == "__main__":
    main()
