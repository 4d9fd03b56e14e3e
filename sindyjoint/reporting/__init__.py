"""What results show: one view for each kind, in one registry; figures, tables, pages, files."""

from typing import TYPE_CHECKING

from sindyjoint.hooks import fetched

if TYPE_CHECKING:
    from sindyjoint.reporting.equation import terms_csv
    from sindyjoint.reporting.output import write_results
    from sindyjoint.reporting.registry import draw, drawable, load_results

__all__ = ["draw", "drawable", "load_results", "terms_csv", "write_results"]

__getattr__ = fetched(
    __name__,
    {
        "equation": "TERM_COLUMNS model_table term_rows terms_csv",
        "figure": "Kind",
        "output": "PAGE figures_of place_of text_of write_results",
        "mathml": "effect_mathml mathml",
        "page": "Provenance number provenance",
        "registry": "draw draw_all drawable drawing kinds_of load_results record_names record_schema saved_text show "
        "view_of",
        "results.diagnosis": "advice_words",
        "results.discovery_data": "GroupFit Loop PathStep ReportData model_sheets",
        "results.verification": "KEPT_SAMPLES thinned",
        "results.discovery": "DISCOVERY",
        "style": "drawing_style DOUBLE_COLUMN SINGLE_COLUMN figure_bytes prefixed pretty_unit shortened",
        "tables": "DASH TextTable csv_text findings_table fitting_blocks terminal_table",
    },
)
