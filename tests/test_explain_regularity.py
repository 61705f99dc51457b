"""``locbounds explain regularity``."""

import locbounds as lb
from datasets import PROJECT
from locbounds.registry import TOPICS


def test_explain_tells_when_bounds_exist_and_whom_to_cite():
    text = lb.explain("regularity")
    for word in ("jump", "edge", "cusp", "kink", "undecided", "Weiss-Weinstein"):
        assert word in text
    known = (PROJECT / "docs" / "references.bib").read_text()
    for topic in TOPICS.values():
        keys = topic.rpartition("cite")[2].split(",")
        assert all(f"{{{key.strip()}," in known for key in keys)
