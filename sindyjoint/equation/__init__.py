"""What a term and a joint model are: formulas, catalogues, units, rendering; no data and no fit."""

from sindyjoint.hooks import fetched

__getattr__ = fetched(
    __name__,
    {
        "calibration": "gain_errors with_gain_uncertainty",
        "catalogue_file": "read_model read_models",
        "candidates": "is_rate_free rate_free with_dependences without_rate",
        "catalogue": "Catalogue as_catalogue default_candidates library_folder list_catalogues load_catalogue",
        "element": "ElementState Form JointElement Value",
        "formula": (
            "FUNCTIONS compile_terms formula_latex formula_pretty formula_text formula_unit parameter_symbol "
            "parse_formula state_symbol variable_symbols"
            " coefficient_unit is_coherent parse_unit same_dimension to_si unit_for unit_text"
        ),
        "model": "Fitted INERTIA JointModel ModelTerm model_terms",
        "model_parts": "range_warnings",
        "terms": "Reference term_columns",
        "test_record": "Drift Nuisance TestNuisances channel_delay read_test",
    },
)
