#!/usr/bin/env python3
"""Makes a source file of the worked examples in public headers, so that a test compiles them.

usage: header_examples.py OUT.cpp HEADER...    An example is the indented text below a line "// Example:" in the comment that opens
a header; its #include lines are lifted out of the function that the rest becomes. Headers without one are left out; fewer than ten
examples are an error.
"""
import pathlib
import re
import sys


def example(path):
    lines = path.read_text().splitlines()
    if "// Example:" not in lines:
        return None
    body = []
    for line in lines[lines.index("// Example:") + 1:]:
        if line != "//" and not line.startswith("//     "):
            break
        body.append(line[7:])
    return body


def main():
    out, headers = pathlib.Path(sys.argv[1]), [pathlib.Path(a) for a in sys.argv[2:]]
    includes, functions = set(), []
    for header in sorted(headers):
        body = example(header)
        if body is None:
            continue
        name = "/".join(header.parts[-3:])
        includes.add(f"#include <{name}>")
        includes.update(line.strip() for line in body if line.startswith("#include"))
        rest = "\n".join("    " + line for line in body if not line.startswith("#include"))
        functions.append(f"// {name}\n[[maybe_unused]] void example_{re.sub('[^a-z0-9]', '_', name)}() {{\n{rest}\n}}\n")
    if len(functions) < 10:
        sys.exit(f"only {len(functions)} headers have an example")
    text = "// The worked examples of the headers, as they stand there.\n#include <iostream>\n\n" + "\n".join(sorted(includes))
    text += "\n\nnamespace {\n\n" + "\n".join(functions) + "\n}  // namespace\n"
    if not out.exists() or out.read_text() != text:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(text)


if __name__ == "__main__":
    main()
