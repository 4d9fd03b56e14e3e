"""Command lines that nobody would type, made from the options that there are, by a seed and a number."""

from __future__ import annotations

import json
import os
import random
import warnings
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path

from fuzz_inputs import NUMBERS, TEXTS

#: What would leave the folder of the test, or the machine: paths upwards, addresses; and what waits for an answer.
ELSEWHERE = ("--cluster", "--install-completion", "--show-completion")
#: What a command takes, where it works.
TAKEN = {
    **dict.fromkeys(("init", "check", "discover", "compare", "batch", "diagnose"), ["campaign"]),
    "verify": ["model", "campaign"], "changed": ["campaign", "campaign"], "rig": ["pulse-rig"], "curves": ["model"],
    "export": ["model"], "plan": ["--like", "inter-panel"], "libraries show": ["paper"], "libraries check": ["paper"],
}  # fmt: skip
SAID = (
    "campaign",
    "campaign/campaign.toml",
    "model",
    "model.json",
    "pulse-rig",
    "paper",
    "inter-panel",
    "run.csv",
    "new",
)
USUAL = (
    "1",
    "2",
    "0.5",
    "3 5",
    "0.1 0.9",
    "3 Hz",
    "0.5 N*m",
    "moment",
    "csv",
    "stlsq",
    "theta=1",
    "k1",
    "all",
)


@dataclass(frozen=True)
class OptionsTarget:
    """Every command with some of its options, their values usual, hostile or missing."""

    commands: dict[str, list[str]]
    place: Path

    def make(self, kind: str, seed: int, number: int) -> str:
        rng = random.Random(f"{kind}/{seed}/{number}")
        # A null byte is in no argument that a system hands on.
        harmless = [text for text in TEXTS if not set("/\\\0") & set(text) and ".." not in text]
        name = rng.choice(sorted(self.commands))
        taken = TAKEN.get(name, []) if rng.random() < 0.7 else rng.sample(SAID, rng.choice((0, 1, 1, 2)))
        words = [*name.split(), *taken]
        for _ in range(rng.choice((0, 1, 1, 2, 4))):
            words.append(
                rng.choice([each for each in self.commands[name] or ["--json"] if each not in ELSEWHERE])
            )
            if rng.random() < 0.7:
                words.append(rng.choice([*NUMBERS, *harmless, *USUAL, *SAID]))
        return json.dumps(words)

    def run(self, given: str, folder: Path) -> None:
        """Run a command line; whatever is wrong with its end is raised."""
        from sindyjoint.errors import InputError
        from tests.doors.asked import ask

        with chdir(self.place), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            answer = ask(*json.loads(given))
        assert answer.status in (0, 1, 2), answer
        assert "Traceback" not in answer.stderr and "\x1b" not in answer.stderr, answer
        # A bare command explains itself.
        assert answer.status != 2 or answer.stderr or answer.stdout.startswith("Usage: "), answer
        if answer.status == 2:
            raise InputError(answer.stderr.splitlines()[-1] if answer.stderr else "a bare command")


def options_target(folder: Path) -> OptionsTarget:
    """Return the command lines, in a folder with a campaign and a model."""
    from made_models import paper_model

    from sindyjoint import simulate
    from tests.doors.inventory import GOLDEN

    place = folder / "options"
    (place / "model").mkdir(parents=True, exist_ok=True)
    simulate(
        random_state=0,
        duration=0.6,
        frequencies=(4.0,),
        levels=(0.5, 0.9),
        out=place / "campaign",
        force=True,
    )
    for path in (place / "model.json", place / "model" / "model.json"):
        path.write_text(paper_model().to_json(), encoding="utf-8")
    os.environ.setdefault("COLUMNS", "100")
    commands = json.loads(GOLDEN.read_text(encoding="utf-8"))["commands"]
    return OptionsTarget(commands, place)
