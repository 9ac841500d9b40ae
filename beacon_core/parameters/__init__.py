"""Hints as parameters of the nodes that they are about, whatever the nodes are asked by.

A hint is written down as parameters, and read, by :mod:`.fields`. :mod:`.asker` asks nodes for
theirs through the port :mod:`beacon_core.ports.asking`, as :mod:`beacon_core.poller` plans it, and
tells a sink what follows (:mod:`.teller`). How it may be configured is in :mod:`.polling`.
"""
