"""The concealed trial: rigs whose left-out physics is hidden from the tool that has to find it.

The generator is a second, independent program: it imports nothing of :mod:`flexdrive_gym` or :mod:`identification`, has
its own equations, its own integrator (a fine fixed step) and, wherever another form is physically as good, other
functional forms. A diagnosis that succeeds on its recordings has therefore not merely inverted its own simulator.
"""
