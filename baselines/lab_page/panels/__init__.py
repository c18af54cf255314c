"""One module per panel of the page; each builds its elements and updates them when the visitor's settings change."""
