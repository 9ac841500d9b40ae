"""A hint as bytes: :mod:`.json` for carriers of our own, :mod:`.cdr` as ROS 2 writes it.

Both offer ``encode(hint, stamp_ns=0)``, giving bytes, and ``decode(payload)``, giving an
``Announcement`` or ``Malformed``. An encoding is not a dependency: neither module needs ROS or
any other package. What a ROS message is beside its bytes is in :mod:`.medkit`.
"""
