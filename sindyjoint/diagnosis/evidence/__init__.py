"""What the data say of a set of terms and effects: whitened rows, one predictive score, one search over sets."""
