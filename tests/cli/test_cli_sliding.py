"""A joint that slides is told of in force, displacement and velocity, wherever a person reads."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from sindyjoint.diagnosis.campaign import rivals
from sindyjoint.diagnosis.campaign.designs import designs, hidden_campaign
from sindyjoint.files import write_campaign
from tests.doors.asked import ask

# Ids of terms and effects hold an underscore, and are the same for both kinds of motion.
ROTATION = re.compile(r"(?i)(?<![\w-])(angles?|angular|moments?|inertia|[mµ]?rad|[mkµ]?N[·*]m)(?![\w-])")


class Words(HTMLParser):
    """All that a person reads of a page, or is read to: text and labels, no scripts."""

    def __init__(self):
        super().__init__()
        self.inside, self.words = "", []

    def handle_starttag(self, tag, attrs):
        self.inside = tag
        self.words += [value for name, value in attrs if name in ("aria-label", "title", "alt") and value]

    def handle_data(self, data):
        if self.inside not in ("script", "style"):
            self.words.append(data)

    def handle_endtag(self, tag):
        self.inside = ""


@pytest.fixture(scope="module")
def slide(tmp_path_factory):
    """Return the folder of a campaign of a sliding joint, in which an effect is hidden."""
    campaign, _ = hidden_campaign(1)
    joint = replace(campaign.joint, motion="translation", name="slide")
    folder = tmp_path_factory.mktemp("slide")
    write_campaign(replace(campaign, joint=joint, runs=campaign.runs[::2]), folder)
    return folder


def told(output: str, folder: Path) -> dict[str, str]:
    """Return what is read, by where."""
    parts = {"stdout": output}
    for path in folder.rglob("*"):
        if path.suffix == ".html":
            page = Words()
            page.feed(path.read_text(encoding="utf-8"))
            parts[path.name] = "\n".join(page.words)
        elif path.suffix == ".csv":
            parts[path.name] = path.read_text(encoding="utf-8").replace(",", " ")
        elif path.suffix == ".svg":
            # matplotlib repeats every text that it draws in a comment.
            parts[path.name] = "\n".join(
                re.findall(r"<!--(.*?)-->", path.read_text(encoding="utf-8"), re.DOTALL)
            )
    return parts


@pytest.mark.parametrize("command", ["discover", "diagnose"])
def test_no_word_of_rotation(command, slide, tmp_path, monkeypatch, pictures):
    # What is read of an advised run is the same, however many were tried.
    monkeypatch.setattr(rivals, "designs", lambda *given: designs(*given)[::15])
    arguments = [command, str(slide), "--out", str(tmp_path / "out"), "--quiet"]
    arguments += ["--max-effects", "1"] * (command == "diagnose")
    result = ask(*arguments)
    assert result.status == 0, result.stderr
    parts = told(result.stdout, tmp_path / "out")
    assert len(parts) > 4 and re.search("force.*displacement", " ".join(parts["stdout"].split()))
    found = {name: [m[0] for m in ROTATION.finditer(text)] for name, text in parts.items()}
    assert not any(found.values()), {name: words for name, words in found.items() if words}
    assert "rate squared" not in parts["report.html"]


def test_a_library_is_shown_in_the_words_of_a_sliding_joint():
    shown = ask("libraries", "show", "extended", "--motion", "translation").stdout
    meanings = "\n".join(line.partition("  ")[2] for line in shown.splitlines())
    assert "elastic force in proportion to the displacement" in meanings
    assert not ROTATION.findall(meanings)
