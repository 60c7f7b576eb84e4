"""Margins: what champions keep on robots that differ a little from their own."""
