"""What sensors measured and how well: runs of their signals, fused where several see one motion, and their noise."""

from sindyjoint.hooks import fetched

__getattr__ = fetched(
    __name__,
    {
        "noise": "channel_noise coherent_to_the_top difference_noise moment_noise motion_noise "
        "quantisation_step signal_end",
        "runs": "along_path measured_run reversals travelled white_noise with_channels",
        "sensors": "averaged disagreement fuse integrated_twice sensor_noise",
    },
)
