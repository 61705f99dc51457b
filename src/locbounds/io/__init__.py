"""Files: scenarios, anchor tables, and writing results so that nothing is ever left half-written."""
