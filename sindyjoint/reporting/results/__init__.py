"""How each kind of result is told, drawn and written: one file, one view for each."""
