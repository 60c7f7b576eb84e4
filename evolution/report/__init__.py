"""Reports of studies: tables, figures, pages, and the paper's claims."""
