"""Figures: each panel is a function ``f(data, ax)``, each file names the kinds of figure of one result."""
