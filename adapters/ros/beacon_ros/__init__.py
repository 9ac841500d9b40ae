"""What the ROS 2 adapters stand on: contexts, raw types, a reader, an executor thread, the graph.

Importing this package needs no ROS; its modules do, apart from :mod:`.environment`.
"""
