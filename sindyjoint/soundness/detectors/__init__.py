"""One detector of faulty data per file: each takes a run or a campaign and returns its findings."""
