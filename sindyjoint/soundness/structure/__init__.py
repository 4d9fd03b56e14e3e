"""Are the data of a structure sound: its channels one by one, and held against each other through the structure."""
