"""HTML documents that need no other file."""

from __future__ import annotations

import html

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1b2631; margin: 2em auto; max-width: 72em;
       padding: 0 1em }
h1 { font-size: 1.5em } h2 { font-size: 1.15em; margin-top: 2em }
table { border-collapse: collapse; font-size: 13px } th, td { padding: .2em .7em; text-align: right;
  border-bottom: 1px solid #d5dbe1 } th:first-child, td:first-child { text-align: left }
figure { margin: 1em 0; overflow-x: auto } figcaption { color: #566573; font-size: 13px }
svg { max-width: 100%; height: auto } details { font-size: 13px }
code { font-size: 12px; word-break: break-all } .note { color: #566573 }
"""


def document(title: str, style: str, body: str) -> str:
    """Return an HTML document with a title, additional rules of its style sheet, and a body."""
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>{html.escape(title)}</title><link rel="icon" href="data:,">'
        f"<style>{STYLE}{style}</style></head><body>{body}</body></html>\n"
    )
