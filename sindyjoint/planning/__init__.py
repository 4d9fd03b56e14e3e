"""Which runs to make: what each would tell of a joint that is known only roughly, and which together tell most."""
