#!/usr/bin/env python3
"""Writes which names a shared library exports, as a version script for the linker.

usage: exported_names.py MAP VERSION NM BUILD INSIDES OBJECT...

Of what the objects define, the names that public headers declare are exported with the version RTSG_<VERSION>, and those that the file INSIDES
lists, as libraries and programs of ours need them, with RTSG_<VERSION>_PRIVATE. All else stays inside. tests/exported_symbols.py checks libraries
with the same functions, and tests/exported_names.py compares these with a compiler.
"""
import pathlib
import re
import subprocess
import sys

import libraries

SKIPPED = re.compile(r'R"([^(\s]*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])+\'(?!\w)|//[^\n]*|/\*.*?\*/|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*', re.S | re.M)
OPERATOR = re.compile(r"\boperator\b\s*(\(\s*\)|\[\s*\]|<=>|<<=?|>>=?|->\*?|[-+*/%^&|~!=<>,]=?|&&|\|\||\+\+|--|\w)")
SCOPE = re.compile(r"(?:inline\s+)?(namespace|class|struct|union|enum(?:\s+class)?)\b(?:\s*alignas\s*\([^()]*\))?\s*([\w:]*)[^()=]*$")
NO_NAME = re.compile(r"(?:using|typedef|static_assert|friend\s+(?:class|struct)|(?:class|struct|union|enum)\s[^()=]*$)\b|[^\w~]|$")
TABLE = re.compile(r"(?:vtable|typeinfo name|typeinfo|VTT) for ")
BESIDE = re.compile(r"(?:guard variable|TLS init function|TLS wrapper function|(?:non-)?virtual thunk|covariant return thunk)(?: for| to) ")


def plain(text):
    """Without the arguments of templates, and up to the parenthesis of a function's parameters."""
    kept, depth = "", 0
    for c in text:
        if c == "(" and not depth and not re.search(r"\b(?:explicit|decltype|alignas|operator)\s*$", kept):
            break
        depth += (c == "<") - (c == ">" and depth > 0)
        kept += c if not depth and c != ">" else ""
    return kept


def path(text):
    """The name of a declaration or of a demangled symbol, with the scopes before it, as a tuple."""
    text = re.sub(r"\[\[.*?\]\]|\[abi:\w+\]", "", text.replace("(anonymous namespace)", "unnamed"))
    operator = OPERATOR.search(text)
    last = ()
    if operator and plain(text[:operator.start()] + "operator").endswith("operator"):  # none among the parameters of another function
        sign = "".join(operator.group(1).split())
        last = ("operator " + ("type" if sign.isidentifier() else sign),)
        text = text[:operator.start()]
    name = plain(text) if last else re.split(r"[=\[{]", plain(text))[0].strip()
    return tuple(part for part in re.split(r"[\s*&]", name)[-1].split("::") if part) + last


def without_template(head):
    """Without `template <...>` before it."""
    while head.startswith("template"):
        depth = 0
        for i, c in enumerate(head):
            depth += (c == "<") - (c == ">")
            if c == ">" and not depth:
                head = head[i + 1:].strip()
                break
        else:
            return ""
    return head


class Declared:
    """Which types headers define, and which functions and variables they declare, by their paths."""

    def __init__(self, texts):
        self.types, self.names = set(), set()
        for text in texts:
            self.read(SKIPPED.sub(" ", text))

    def read(self, text):
        scopes, head = [], ""  # scopes: names, or None inside of functions and initial values
        for c in text:
            if c not in "{};":
                head += c
                continue
            if None not in scopes:
                head = without_template(re.sub(r"\[\[.*?\]\]|^(?:\s*(?:public|private|protected)\s*:(?!:)|\s*RTSG_\w+\(\w+\))+", "", head).strip())
                opened = SCOPE.match(head) if c == "{" else None
                if opened:
                    scopes.append(tuple(part for part in opened.group(2).split("::") if part))
                    if opened.group(1) != "namespace":
                        self.types.add(self.inside(scopes))
                    head = ""
                    continue
                if c != "}" and not NO_NAME.match(head):
                    self.names.add(self.inside(scopes[:1] if head.startswith("friend") else scopes) + path(head))
                if "(" not in head or "=" in plain(head):  # more variables of the type
                    self.names |= {self.inside(scopes) + (name,) for name in re.findall(r",\s*(\w+)\s*=", head)}
            if c == "{":
                scopes.append(() if head.startswith("extern") else None)
            elif c == "}" and scopes:
                scopes.pop()
            head = ""

    @staticmethod
    def inside(scopes):
        return tuple(part for scope in scopes for part in scope)

    def has(self, symbol):
        """Whether a demangled symbol is declared: a name, a type's table, or what a compiler makes by itself for a type."""
        if TABLE.match(symbol):
            return "(" not in symbol and path(TABLE.sub("", symbol)) in self.types
        if "{lambda" in symbol:  # each who compiles the function has one
            return False
        name = path(BESIDE.sub("", symbol))
        if name in self.names:
            return True
        return name[:-1] in self.types and name[-1] in (name[-2], "~" + name[-2], "operator =")


def defined(nm, files, *options):
    """(symbol, the same demangled) of all that the files define for others."""
    listed = [subprocess.run([nm, "-p", "--defined-only", *options, *how, *files], capture_output=True, text=True, check=True).stdout for how in ([], ["-C"])]
    pairs = [(raw.split(" ", 2)[2], shown.split(" ", 2)[2])
             for raw, shown in zip(*(text.splitlines() for text in listed)) if raw.count(" ") >= 2 and not raw.endswith(":")]
    return sorted(set(pairs))


class Insides:
    """Names that our own libraries and programs need, one a line: a name, or a type or namespace and all that is in it."""

    def __init__(self, file):
        lines = [line.split("#")[0].strip() for line in pathlib.Path(file).read_text().splitlines()]
        self.lines = {tuple(line.split("::")): line for line in lines if line}

    def line(self, symbol):
        """The line that lists the symbol, or None."""
        name = path(TABLE.sub("", BESIDE.sub("", symbol)))
        return next((self.lines[name[:length]] for length in range(len(name), 0, -1) if name[:length] in self.lines), None)


def declared(build):
    """What the public headers declare, those that the build makes among them."""
    headers = [*libraries.public_headers(), *pathlib.Path(build).glob("core/generated/rtsg/core/*.h")]
    return Declared(file.read_text() for file in sorted(headers))


def main():
    made, version, nm, build, insides, *objects = sys.argv[1:]
    api, insides = declared(build), Insides(insides)
    public, private = [], []
    for raw, shown in defined(nm, [file for file in objects if not file.endswith(".gch")], "-g"):
        if api.has(shown):
            public.append(raw)
        elif insides.line(shown):
            private.append(raw)
    lines = [f"RTSG_{version} {{", "  global:", *(f"    {name};" for name in public), "  local: *;", "};"]
    if private:
        lines += [f"RTSG_{version}_PRIVATE {{", "  global:", *(f"    {name};" for name in private), "};"]
    pathlib.Path(made).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
