"""Pictures, videos, figures and rerun recordings of trials."""
