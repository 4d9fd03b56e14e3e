"""What the record of a diagnosis holds, in its order."""

KEYS = [
    "schema",
    "verdict",
    "reason",
    "gap",
    "budget",
    "where",
    "steps",
    "advice",
    "advice_search",
    "warnings",
]
