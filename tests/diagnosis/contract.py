"""What the record of a diagnosis holds, in its order."""

KEYS = [
    "schema",
    "verdict",
    "reason",
    "trust",
    "gap",
    "budget",
    "where",
    "steps",
    "advice",
    "advice_search",
    "warnings",
]
