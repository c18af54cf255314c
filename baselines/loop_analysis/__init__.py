"""The sampled loop of a drive and a controller: stability, margins, limit cycles, the equivalent gain of a controller."""
