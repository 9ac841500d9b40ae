"""ROS 2 over Zenoh without ROS: robots that run rmw_zenoh, heard and spoken to with Zenoh alone."""
