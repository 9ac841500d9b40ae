# Finds ROS where pip put it: in the build's own environment.
#
# Each ros-* wheel is a piece of a ROS install tree (share, lib, include), laid out over the
# prefix of that environment. A module of one of them tells where that is; sys.prefix does not,
# since pip builds with the interpreter of another environment.

find_package(Python3 REQUIRED COMPONENTS Interpreter)
execute_process(
  COMMAND "${Python3_EXECUTABLE}" -c
    "import pathlib, rosidl_cmake; print(pathlib.Path(rosidl_cmake.__file__).resolve().parents[4])"
  OUTPUT_VARIABLE ros_prefix
  OUTPUT_STRIP_TRAILING_WHITESPACE
  COMMAND_ERROR_IS_FATAL ANY
)

# For find_package, before any ROS that the caller's shell may have sourced.
list(PREPEND CMAKE_PREFIX_PATH "${ros_prefix}")

# For ament's index, by which the generators find each other; instead of any sourced ROS.
set(ENV{AMENT_PREFIX_PATH} "${ros_prefix}")

# What ament asks Python for is local/lib/python3/dist-packages on Debian; virtual environments
# have this.
set(PYTHON_INSTALL_DIR
  "lib/python${Python3_VERSION_MAJOR}.${Python3_VERSION_MINOR}/site-packages")
