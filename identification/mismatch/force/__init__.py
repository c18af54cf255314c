"""The force that a drive lacks, estimated from recordings without a model of it, and what it follows."""
