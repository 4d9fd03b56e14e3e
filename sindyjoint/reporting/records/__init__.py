"""What the result files and ``--json`` hold, of which ``sindyjoint schema`` prints the JSON Schema."""
