"""One detector for each fault of channels, whether the record is of a joint or of a structure."""
