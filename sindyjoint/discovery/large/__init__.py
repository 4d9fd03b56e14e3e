"""Discovery from data larger than memory: passes over segments of runs and of tables of rows."""
