# Takes the include directories of the machine that built the ros-* wheels out of their targets.
#
# The targets name that machine's Python headers (/opt/python/cp311-cp311/include/python3.11), and
# CMake refuses a target whose include directory does not exist. The headers of the Python at hand
# are found by rosidl_generator_py itself.

get_property(imported_targets DIRECTORY PROPERTY IMPORTED_TARGETS)
foreach(target IN LISTS imported_targets)
  get_target_property(directories ${target} INTERFACE_INCLUDE_DIRECTORIES)
  if(directories)
    list(FILTER directories EXCLUDE REGEX "^/opt/python/")
    set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${directories}")
  endif()
endforeach()
