"""Which terms the data need: triangular factors, evidence, selection, methods, cross-validation, uncertainty."""
