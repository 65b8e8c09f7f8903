#!/usr/bin/env python3
"""Writes what Doxygen reads of public headers and pages to a folder.

usage: doxygen_filter.py FOLDER

Comments of headers are plain text with backticks: the one that opens a header becomes that file's, and that of each class in it which has none
(whole for those that it names, its first sentence for others); what it says about threads and sources becomes paragraphs of each. Indented lines become code, and what Doxygen would take for commands does not. Headings of pages get the names that links to them have, which are those of GitHub, with the
page's before them, as Doxygen knows one set of names for all pages. Links to what the site does not have become plain text.
"""
import itertools
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "cmake"))
import libraries  # noqa: E402


def plain(text):
    """Text without commands, what stands in backticks aside."""
    pieces = re.split(r"(`[^`]*`)", text)
    for i, piece in enumerate(pieces):
        pieces[i] = piece if i % 2 else re.sub(r"([\\@#%<>])", r"\\\1", piece).replace("\\>::", "\\>\\::")
    return re.sub(r"(?<![\w>\\])::", r"\\::", "".join(pieces))


CLASS = re.compile(r"(?:class|struct) (?:\[\[\w+\]\] )?(\w+)(?: final)?(?: :[^{;]*)?\s*\{")


def classes_without_comment(lines):
    """Where a class begins, with its template: its name."""
    found = {}
    for at, line in enumerate(lines):
        match = CLASS.match(re.sub(r"^template <.*>\s*(?=class|struct)", "", line))
        begin = at - 1 if match and at > 0 and re.match(r"template <.*>$", lines[at - 1]) else at
        if match and not lines[begin - 1].startswith("///"):
            found[begin] = match[1]
    return found


def classes(lines):
    """Where each class at the outermost level begins, with its template."""
    at = [i for i, line in enumerate(lines) if CLASS.match(re.sub(r"^template <.*>\s*(?=class|struct)", "", line))]
    return {i - 1 if i > 0 and re.match(r"template <.*>$", lines[i - 1]) else i for i in at}


def paragraphs(lines):
    """Of the comment that opens a header: what it says about threads and sources, by its word."""
    opening = "\n".join(line[2:].strip() for line in itertools.takewhile(lambda line: line.startswith("//"), lines))
    found = ((word, re.search(rf"\b{word}: (.*?)(?=\s[A-Z][a-z]+: |\n\n|\Z)", opening, re.S)) for word in ("Threading", "Source"))
    return {word: " ".join(match[1].split()) for word, match in found if match}


def header(text):
    lines = text.splitlines()
    bare, said, begins, about = classes_without_comment(lines), [], classes(lines), paragraphs(lines)
    out, opening, code = ["/// @file"], True, False
    for at, line in enumerate(lines):
        if opening and line.startswith("#pragma once"):
            said = out[1:] + ["/// @endcode"] * code
        if at in bare:
            names = re.match(r"/// ([\w:, ]*?): ", said[0] + " ") if said else None
            whole = names and bare[at] in re.split(r"\W+", names[1])
            first = re.match(r"(?:///.*?\.(?=\s|$)|///.*?$)", " ".join(one if i == 0 else one[3:].strip() for i, one in enumerate(said)))
            out += said if whole else [first[0]] if first else []
        if at in begins and not (at in bare and whole):
            for word, words in about.items():
                out += [f"/// @par {word}", f"/// {plain(words)}", "///"]
        opening = opening and not line.startswith("#pragma once")
        comment = re.match(r"(\s*)//(/?<?)( {0,4})(.*)" if opening else r"(.*?)(?:(?<=\s)|^)//(/<?)( {0,4})(.*)", line)
        if not comment:
            out += ["/// @endcode"] * code + [line]
            code = False
            continue
        before, kind, _, words = comment.groups()
        mark = f"{before}//{kind if kind else '/'}"
        indented = opening and line.startswith("//     ")
        if indented != code:
            out.append("/// @code{.cpp}" if indented else "/// @endcode")
            code = indented
        out.append(f"///{line[2:]}" if indented else f"{mark} {plain(words)}")
    return "\n".join(out + ["/// @endcode"] * code) + "\n"


def slug(heading):
    """As GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", heading.replace("`", "").lower()).strip().replace(" ", "-")


def label(path):
    """Of a page; two pages may have names that only differ in case."""
    return path.stem.lower() if path.parent.name == "docs" else f"about-{path.stem.lower()}"


def page(text, path):
    def link(match):
        words, aim = match.groups()
        if aim.startswith(("http:", "https:")):
            return match[0]
        name, _, anchor = aim.partition("#")
        to = (path.parent / name).resolve() if name else path
        if to.suffix == ".md" and (to.parent in (ROOT, ROOT / "docs")):
            return f"[{words}](#{label(to)}{'-' + anchor if anchor else ''})"
        return words

    out, words, fenced = [], [], False

    def end_words():
        """Links may begin in one line and end in the next."""
        joined = re.sub(r"!\[([^\]]*)\]\((?:[^)\s]*/)?([^)\s/]+)\)", r"![\1](\2)", "\n".join(words))
        out.extend(re.sub(r"(?<!!)\[([^\]]*)\]\(([^)\s]+)\)", link, joined).split("\n") if words else [])
        words.clear()

    for number, line in enumerate(text.splitlines()):
        fenced ^= line.startswith("```")
        heading = None if fenced else re.match(r"(#+) (.*)", line)
        if not fenced and not heading and not line.startswith("    "):
            words.append(line)
            continue
        end_words()
        if heading:
            name = label(path) + ("" if number == 0 else "-" + slug(heading[2]))
            line = f"{heading[1]} {heading[2]} {{#{name}}}"
        out.append(line)
    end_words()
    return "\n".join(out) + "\n"


def example(path):
    """So that pages of what the program uses lead to it."""
    comment = itertools.takewhile(lambda line: line.startswith("//"), path.read_text(encoding="utf-8").splitlines())
    return f"/** @example {path.name}\n{plain(' '.join(line[2:].strip() for line in comment))} */\n"


def main():
    to = pathlib.Path(sys.argv[1])
    for path in (*sorted(ROOT.glob("*.md")), *sorted(ROOT.glob("docs/*.md")), *libraries.public_headers()):
        text = path.read_text(encoding="utf-8")
        inside = path.relative_to(ROOT) if path.suffix == ".md" else pathlib.Path(*path.relative_to(ROOT).parts[-3:])
        (to / inside).parent.mkdir(parents=True, exist_ok=True)
        (to / inside).write_text(page(text, path) if path.suffix == ".md" else header(text), encoding="utf-8")
    (to / "examples.h").write_text("".join(example(path) for path in (*sorted(ROOT.glob("examples/*.cpp")), *sorted(ROOT.glob("app/verbs/verb_*.cpp")))), encoding="utf-8")


if __name__ == "__main__":
    main()
