"""What noise and processing do to coefficients, measured on synthetic replicates of the campaign, and taken out."""
