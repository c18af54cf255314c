"""What a diagnosis says: findings, errors, intervals, homogeneity, what has no name, and what to record next."""
