"""The verbs of the command line, as functions: what each takes, the stages it goes through, what it returns."""
