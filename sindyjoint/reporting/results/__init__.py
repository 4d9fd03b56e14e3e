"""How each kind of result is shown, drawn and written: one file, one view for each."""
