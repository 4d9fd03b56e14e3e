"""What the model lacks: gaps, candidate effects and their probabilities, verdict, budget, localisation, advice."""
