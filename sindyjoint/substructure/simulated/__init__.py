"""What a structure with models in its joints answers to measured drives, beside what its sensors showed."""
