#!/usr/bin/env python3
"""Does docs/diagnostics.md list exactly the codes that the sources use, and does every report have a code of its own?

A code stands in a source as DiagnosticCode("word") or DiagnosticCode kName{"word"}. A report that names none gets that of its source file, from the table
in core/src/value/diagnostic.cpp: so each file that reports must match a row there, and each row must be the first match of
a file. Exit status 1 and a line for each fault.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "cmake"))
import libraries  # noqa: E402

CODE = re.compile(r'DiagnosticCode\(\s*"([^"]*)"')
CONSTANTS = re.compile(r'DiagnosticCode\s+k[^;]*;')
REPORTS = re.compile(r'\b(?:fail|error|warning|warn|report)\s*\(|Diagnostic\{|\{Severity::|->fatal\(')
TABLE = "core/src/value/diagnostic.cpp"


def check(root):
    faults, used = [], set()
    listed = re.findall(r"^\| `([a-z0-9-]+)` \|", (root / "docs/diagnostics.md").read_text(), re.M)
    table = re.findall(r'\{"(/[^"]*)", DiagnosticCode\("([^"]*)"\)\}', (root / TABLE).read_text())
    met = set()
    for folder in (*libraries.FOLDERS, "app"):
        for path in sorted((root / folder).rglob("*")):
            if path.suffix not in (".cpp", ".h") or "tools" in path.parts:
                continue
            name, text = str(path.relative_to(root)), path.read_text()
            codes = CODE.findall(text)
            for constants in CONSTANTS.findall(text):
                codes += re.findall(r'\{"([^"]*)"\}', constants)
            if name == TABLE:
                codes = [code for code in codes if code == "application"] + [code for _, code in table]
            elif name == "core/include/rtsg/core/diagnostic.h":
                continue
            used.update(codes)
            row = next((i for i, (part, _) in enumerate(table) if part in "/" + name), None)
            if row is not None:
                met.add(row)
            elif path.suffix == ".cpp" and REPORTS.search(text):
                faults.append(f"{name}: reports, and matches no row of the table in {TABLE}")
    faults += [f"{TABLE}: no source file has the code of '{part}'" for i, (part, _) in enumerate(table) if i not in met]
    faults += [f"docs/diagnostics.md: '{code}' is used and not listed" for code in sorted(used - set(listed))]
    faults += [f"docs/diagnostics.md: '{code}' is listed and not used" for code in sorted(set(listed) - used)]
    faults += [f"docs/diagnostics.md: '{code}' is listed twice" for code in sorted({c for c in listed if listed.count(c) > 1})]
    return faults, used


def main():
    faults, used = check(ROOT)
    for fault in faults:
        print(fault)
    print(f"{len(used)} codes, {len(faults)} faults")
    return 1 if faults or len(used) < 20 else 0


if __name__ == "__main__":
    sys.exit(main())
