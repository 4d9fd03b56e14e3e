"""The door: campaigns from files into SI units, and back."""

from typing import TYPE_CHECKING

from sindyjoint.hooks import fetched

if TYPE_CHECKING:
    from sindyjoint.files.campaign import load_campaign
    from sindyjoint.files.manifest import manifest_schema
    from sindyjoint.files.writers import write_campaign

__all__ = ["load_campaign", "manifest_schema", "write_campaign"]

# pydantic and pint take half a second to import: only when a campaign is read.
__getattr__ = fetched(
    __name__,
    {
        "atomic": "OLD check_output hold_folder name_temporary output_folder prepare_output settle whole_folder "
        "write_bytes write_text",
        "campaign": "load_campaign load_segment",
        "drafting.draft": "draft_manifest",
        "drafting.survey": "survey_folder",
        "manifest": "Manifest manifest_schema",
        "readers": "READERS VARIABLE open_blocks read_table",
        "readers.arrays": "read_arrays",
        "timeaxis": "advanced check_frequency check_order margin resampled uniform_rate",
        "units": "QUANTITIES USUAL conversion parse_quantity unit_ratio",
        "writers": "ENCODERS write_campaign",
    },
)
