"""What sensors measured and how well: runs of their signals, fused where several see one motion, and their noise."""
