"""Which runs to make: the information of each on a joint known only roughly, and which together give most."""
