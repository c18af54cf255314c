"""The diagnosis: which physics a drive's model lacks, by what improves the prediction of recordings it was not estimated from."""
