"""The joint's angle from an accelerometer, alone or beside other sensors of the motion."""

from sindyjoint.accelerometer.fused import Fusion
from sindyjoint.accelerometer.fusion import fuse, unknown_means
from sindyjoint.accelerometer.noise import disagreement

__all__ = ["Fusion", "disagreement", "fuse", "unknown_means"]
