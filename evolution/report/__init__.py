"""Reports of studies: their sections, tables and figures."""
