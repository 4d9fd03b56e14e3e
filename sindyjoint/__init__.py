"""Discover the equation of a nonlinear joint from vibration tests, with evidence."""

from __future__ import annotations

__version__ = "0.1.0"
