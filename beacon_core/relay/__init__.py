"""Any topic, of any type, from one network to another: both sides, without I/O, clock or threads.

The side that takes messages is :mod:`.forwarder`, the side that publishes them :mod:`.republisher`.
What they say to each other is in :mod:`.frames`, what they ask their surroundings to do in
:mod:`.effects`, and where each message ended in :mod:`.ledger`. docs/relay.md tells it in order.
"""
