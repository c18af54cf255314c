"""Recordings replayed by drives: the residuals of the output-error model, one recording at a time or in batches."""
