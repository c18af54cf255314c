"""The laboratory on a drive: the handout's experiments and studies, and figures that can be checked on the rig."""
