"""Controllers, experiments and reports on any identified drive."""
