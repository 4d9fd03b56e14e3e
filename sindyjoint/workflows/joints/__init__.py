"""Many joints: the record of each campaign, the summary of all, the population that they are drawn from."""
