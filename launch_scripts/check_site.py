#!/usr/bin/env python3
"""Checks that every relative link of a built site leads to a file of the site:

    launch_scripts/check_site.py FOLDER

Reads `href`, `src` and `poster` of all pages, and the recordings that links to the page name in
their query. In the chapters of the book, the place behind `#` must exist, too. Needs no network:
links to other hosts are left alone. Exit code 1 if a link is broken.
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import parse_qsl, unquote, urlsplit

# The page for unknown addresses, which a server shows in any folder, so its links are absolute.
LEFT_OUT = {"404.html"}
# Written by rustdoc and pdoc, whose scripts make some of the places that they link to.
OF_OTHERS = "api"
# Parts of links there that cannot be mended here: in the comments of a foreign crate, and of a script
# that is there only if another crate implements the trait.
FOREIGN = ("dispatcher#", "/trait.impl/")


class Page(HTMLParser):
    def __init__(self, file: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.places: set[str] = set()
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("href", "src", "poster") and value is not None:
                self.links.append(value)
            if name in ("id", "name") and value:
                self.places.add(value)


def main(root: Path) -> int:
    files = [file for file in sorted(root.rglob("*.html")) if file.name not in LEFT_OUT]
    pages = {file: Page(file) for file in files}
    checked, broken = 0, []
    for file, page in pages.items():
        is_ours = OF_OTHERS not in file.relative_to(root).parts
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc or (not is_ours and any(part in link for part in FOREIGN)):
                continue
            checked += 1
            target = file
            if parts.path:
                start = root if parts.path.startswith("/") else file.parent
                target = (start / unquote(parts.path).lstrip("/")).resolve()
            if target.is_dir():
                target = target / "index.html"
            named = [value for key, value in parse_qsl(parts.query) if key in ("recording", "beside")]
            is_there = target.is_file() and target.is_relative_to(root)
            is_there = is_there and all((target.parent / value).is_file() for value in named)
            if is_there and is_ours and parts.fragment and target in pages:
                is_there = unquote(parts.fragment) in pages[target].places
            if not is_there:
                broken.append(f"{file.relative_to(root)}: {link}")
    for line in broken:
        print(line, file=sys.stderr)
    print(f"{len(pages)} pages, {checked} links, {len(broken)} broken")
    # A site without pages is no site.
    return 1 if broken or checked < 1000 else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(f"usage: {sys.argv[0]} FOLDER")
    sys.exit(main(Path(sys.argv[1]).resolve()))
