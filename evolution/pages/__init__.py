"""Building blocks of pages: Markdown, HTML, figure style, words."""
