"""The relay as a program: its ends, what drives their cores, what people are told of them.

A core (:mod:`beacon_core.relay`) is handed what happens and gives back what is to be done.
:mod:`.end` carries that out between one network and one conduit, :mod:`.relay` runs all ends of a
configuration, and :mod:`.report` tells how they are.
"""
