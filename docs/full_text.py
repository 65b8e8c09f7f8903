#!/usr/bin/env python3
"""Adds a search through the whole text of the pages to the site that Doxygen has made, whose own search knows names and titles alone.

usage: full_text.py FOLDER

Writes FOLDER/find.html and what it searches, FOLDER/texts.js, and gives the menu an entry. All words that are typed have to occur; pages with more
of them come first. It works from files, without a server.
"""
import html
import json
import pathlib
import re
import sys

PAGE = """<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>RTSG: search</title><link rel="stylesheet" href="doxygen.css"><link rel="stylesheet" href="site.css">
<style>body {{ max-width: 50em; margin: 1em auto; padding: 0 1em }} input {{ width: 100%; font-size: 1.2em }} li {{ margin: .6em 0 }}</style></head><body>
<p><a href="index.html">RTSG</a></p><label>Words in pages and comments <input id="words" type="search" autofocus></label><p id="count" role="status"></p><ol id="found"></ol>
<script src="texts.js"></script><script>
const words = document.getElementById('words'), found = document.getElementById('found'), most = 50;
function find() {{
  const asked = words.value.toLowerCase().split(/\\s+/).filter(Boolean), hits = [];
  for (const [url, title, text] of asked.length ? TEXTS : []) {{
    const low = `${{title}} ${{text}}`.toLowerCase(), counts = asked.map((word) => low.split(word).length - 1);
    if (counts.every(Boolean)) hits.push([counts.reduce((a, b) => a + b) + 100 * asked.filter((word) => title.toLowerCase().includes(word)).length, url, title, text]);
  }}
  hits.sort((a, b) => b[0] - a[0] || (a[1] < b[1] ? -1 : 1));
  document.getElementById('count').textContent = asked.length ? `${{hits.length}} page${{hits.length === 1 ? '' : 's'}}${{hits.length > most ? `, the first ${{most}}` : ''}}` : '';
  found.replaceChildren(...hits.slice(0, most).map(([, url, title, text]) => {{
    const line = document.createElement('li'), link = document.createElement('a'), at = Math.max(0, text.toLowerCase().indexOf(asked[0]) - 60);
    link.href = url;
    link.textContent = title;
    line.append(link, document.createElement('br'), `${{at ? '…' : ''}}${{text.slice(at, at + 180)}}…`);
    return line;
  }}));
}}
words.oninput = () => {{ location.replace(`#${{encodeURIComponent(words.value)}}`); find(); }};
words.value = decodeURIComponent(location.hash.slice(1));
find();
</script></body></html>
"""


def text_of(page):
    """Its title, and its text in one line; without what each page has."""
    title = html.unescape(re.sub(r"<[^>]*>", "", re.search(r"<title>(?:RTSG: )?(.*?)</title>", page, re.S)[1]))
    content = page.partition('<div class="contents">')[2].partition("<!-- contents -->")[0]
    content = re.sub(r"<(script|style)\b.*?</\1>", " ", content, flags=re.S)
    return title, " ".join(html.unescape(re.sub(r"<[^>]*>", " ", content)).split())


def main():
    folder = pathlib.Path(sys.argv[1])
    texts = []
    for file in sorted(folder.glob("*.html")):
        if re.match(r"(class|struct|namespacertsg|md_|index)", file.name) and not file.name.endswith("-members.html"):
            title, text = text_of(file.read_text(encoding="utf-8"))
            texts.append([file.name, title, text])
    if not texts:
        sys.exit(f"full_text.py: no pages in {folder}")
    (folder / "texts.js").write_text(f"const TEXTS = {json.dumps(texts, ensure_ascii=False)};\n", encoding="utf-8")
    (folder / "find.html").write_text(PAGE.replace("{{", "{").replace("}}", "}"), encoding="utf-8")
    menu = folder / "menudata.js"
    entry = '{text:"Search all text",url:"find.html"},'
    said = menu.read_text(encoding="utf-8")
    if entry not in said:
        menu.write_text(said.replace("children:[", f"children:[\n{entry}", 1), encoding="utf-8")
    print(f"{len(texts)} pages, {sum(len(text) for _, _, text in texts) / 1e6:.1f} MB of text")


if __name__ == "__main__":
    main()
