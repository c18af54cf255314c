"""Controllers and policies run and measured: roll-outs, adapters, metrics, their statistics."""
