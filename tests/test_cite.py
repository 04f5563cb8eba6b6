"""`netsp cite` says what `CITATION.cff` says."""

import re
from pathlib import Path

from netsp.command.cite import works
from netsp.command.main import main

CITATION = (Path(__file__).parent.parent / "CITATION.cff").read_text()


def test_the_command_cites_the_works_of_the_file():
    ours, paper = works()
    for work in (ours, paper):
        assert f'title: "{work.title}"' in CITATION
    assert f"- name: {ours.authors}\n" in CITATION
    names = re.findall(r"family-names: (.*)\n +given-names: (.*)\n", CITATION)
    assert paper.authors == " and ".join(f"{family}, {given}" for family, given in names)
    assert f"year: {paper.year}\n" in CITATION
    assert f"date-released: {ours.year}-" in CITATION
    assert f"\nversion: {dict(ours.source)['version']}\n" in CITATION
    assert f'collection-title: "{dict(paper.source)["booktitle"]}"' in CITATION


def test_text_and_bibtex_name_authors_titles_and_years(capsys):
    assert main(["cite"]) == 0
    text = capsys.readouterr().out
    assert main(["cite", "--format", "bibtex"]) == 0
    entries = capsys.readouterr().out
    assert re.findall(r"^@(\w+)\{", entries, re.M) == ["software", "inproceedings"]
    for shown in (text, entries):
        assert all(w.title in shown and w.authors in shown and w.year in shown for w in works())
    assert ".." not in text
