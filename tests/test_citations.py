"""Whom to cite: the words of ``locbounds explain`` are those of the bibliography."""

import re
import unicodedata

import pytest

import locbounds as lb
from datasets import PROJECT
from locbounds.citations import CITATIONS
from locbounds.registry import METHODS, TOPICS

ACCENTS = {"'": "\u0301", "v": "\u030c"}


def plain(text):
    """Without LaTeX."""
    text = re.sub(
        r"\{?\\(['v])\s*\{?([A-Za-z])\}?\}?", lambda m: unicodedata.normalize("NFC", m[2] + ACCENTS[m[1]]), text
    )
    return re.sub(r"[{}]", "", text)


def people(text):
    """First names as initials, before the last name."""
    out = []
    for person in text.split(" and "):
        last, first = person.split(", ")
        initials = (re.sub(r"\w+\.?", lambda m: m[0][0] + ".", name) for name in first.split())
        out.append(" ".join([*initials, last]))
    return out[0] if len(out) == 1 else f"{', '.join(out[:-1])} and {out[-1]}"


def bibliography():
    bib = (PROJECT / "docs" / "references.bib").read_text()
    for key, body in re.findall(r"^@\w+\{(\w+),\n(.*?)^\}", bib, re.M | re.S):
        yield key, {name: plain(value) for name, value in re.findall(r"^  (\w+)\s*=\s*\{(.*)\},$", body, re.M)}


ENTRIES = dict(bibliography())


def test_what_is_cited_has_words_and_nothing_else_has():
    cited = {key for m in METHODS.values() for key in m.references}
    cited |= {key.strip() for topic in TOPICS.values() for key in topic.rpartition("cite")[2].split(",")}
    assert set(CITATIONS) == cited


@pytest.mark.parametrize("key", CITATIONS)
def test_the_words_are_those_of_the_bibliography(key):
    entry = ENTRIES[key]
    where = next((entry[k] for k in ("journal", "booktitle", "publisher") if k in entry), None)
    said = [people(entry["author"]), f'"{entry["title"]}"', where, entry.get("year")]
    assert ", ".join(filter(None, said)) == CITATIONS[key]


def test_explain_prints_them():
    assert f"cite     louis1982: {CITATIONS['louis1982']}" in lb.explain("bcrb").splitlines()
    assert lb.explain("regularity").count("\ncite     ") == 4
