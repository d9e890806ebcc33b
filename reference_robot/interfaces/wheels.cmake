# What the ROS 2 wheels from PyPI need before a standard interface package builds against them.
# pip's builds alone include this file (CMAKE_PROJECT_INCLUDE in each pyproject.toml, after project());
# colcon builds the same packages without it.

# The ROS prefix is wherever pip put the build requirements: an isolated build environment, whose
# bin folder is on PATH, or the virtual environment itself.
find_package(ament_cmake_core REQUIRED)
cmake_path(GET ament_cmake_core_DIR PARENT_PATH ros_prefix)
cmake_path(GET ros_prefix PARENT_PATH ros_prefix)
cmake_path(GET ros_prefix PARENT_PATH ros_prefix)
list(PREPEND CMAKE_PREFIX_PATH "${ros_prefix}")
set(ENV{AMENT_PREFIX_PATH} "${ros_prefix}")
set(ENV{LD_LIBRARY_PATH} "${ros_prefix}/lib:$ENV{LD_LIBRARY_PATH}")

# A message's shared libraries name others that the linker has to find as well.
add_link_options("LINKER:-rpath-link,${ros_prefix}/lib")

# The wheels' Python targets carry the include folders of the machine that built the wheels.
function(roaas_correct_include_folders)
  get_property(imported DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS imported)
    if(target MATCHES "^(.+)::.+__rosidl_generator_py$")
      set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES
        "${Python3_INCLUDE_DIRS};${Python3_NumPy_INCLUDE_DIRS};${ros_prefix}/include/${CMAKE_MATCH_1}")
    endif()
  endforeach()
endfunction()
cmake_language(DEFER CALL roaas_correct_include_folders)
