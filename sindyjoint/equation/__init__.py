"""What a term and a joint model are: formulas, catalogues, units, rendering; no data and no fit."""
