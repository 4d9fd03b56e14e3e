"""What the result files share, as pydantic models.

They describe; the results themselves write. A test validates what every command writes against them. Numbers that are
not known are null.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Known = Annotated[float, Field(allow_inf_nan=False)]
Maybe = Known | None
Version = Annotated[Literal[1], Field(alias="schema")]
Severity = Literal["stops", "biases", "note"]
Sound = Literal["sound", "doubtful", "unsound"]
Joint = Literal["rotation", "translation"]


class Part(BaseModel):
    """Anything in a result file: it has no other keys than these."""

    model_config = ConfigDict(extra="forbid", serialize_by_alias=True)


class SoundnessPart(Part):
    """What the check of the data found, in short."""

    verdict: Sound
    ids: list[str]
    accepted: list[str]
