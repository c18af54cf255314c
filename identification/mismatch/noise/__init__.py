"""What is nobody's missing physics: unknown forces, encoder counts, and what differs from run to run."""
