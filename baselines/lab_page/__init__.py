"""The lab in the browser: the rig, its loop, its physics and its recordings on one local page (``flexdrive lab``).

What the page shows is computed in modules that know nothing of it (:mod:`settings`, :mod:`motion`, :mod:`loop_curves`,
:mod:`stability_lamp`, :mod:`signature`, :mod:`exercise`); :mod:`page` and :mod:`panels` lay it out with NiceGUI, the only modules
that import it, and ``static/`` draws in the browser. Every text is in :mod:`texts`.
"""
