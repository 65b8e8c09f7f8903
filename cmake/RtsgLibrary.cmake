# rtsg_library(NAME DEPENDS ... INSIDES ... LIBRARIES ... OPTIONS ... LEAVE_OUT <source>...): target rtsg_NAME, alias rtsg::NAME, from src/
# (whose folders are rooms, see tests/rooms.py) and include/ of the current folder. A folder sees only the public headers of what it DEPENDS on,
# and the others of what it names among its INSIDES: that is how the arrows are enforced. OPTIONS are the compiler's, for this library alone.
function(rtsg_library name)
  cmake_parse_arguments(ARG "" "" "DEPENDS;INSIDES;LIBRARIES;PRIVATE_LIBRARIES;OPTIONS;LEAVE_OUT" ${ARGN})
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS src/*.cpp)
  # Which sources are compiled together hangs on no option: what one configuration builds, others do.
  set(place 0)
  foreach(source IN LISTS sources)
    math(EXPR group "${place} / 24")
    math(EXPR place "${place} + 1")
    set_source_files_properties("${source}" PROPERTIES UNITY_GROUP "group_${group}")
  endforeach()
  foreach(source IN LISTS ARG_LEAVE_OUT)
    list(REMOVE_ITEM sources "${CMAKE_CURRENT_SOURCE_DIR}/${source}")
  endforeach()
  # Static or shared, as BUILD_SHARED_LIBS says, of the same objects.
  add_library(rtsg_${name} ${sources})
  set_target_properties(rtsg_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON DEFINE_SYMBOL "" VERSION ${PROJECT_VERSION}
                                                SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  if(BUILD_SHARED_LIBS)
    target_link_options(rtsg_${name} PRIVATE -Wl,-z,defs -Wl,-Bsymbolic-functions "-Wl,--version-script=${PROJECT_SOURCE_DIR}/cmake/exported.map")
    # A library finds the modules that it loads, wherever it lies itself: beside them, or in a folder for newer processors.
    set_target_properties(rtsg_${name} PROPERTIES INSTALL_RPATH "$ORIGIN/rtsg;$ORIGIN/../../rtsg")
  endif()
  add_library(rtsg::${name} ALIAS rtsg_${name})
  set_target_properties(rtsg_${name} PROPERTIES EXPORT_NAME ${name} LINKER_LANGUAGE CXX)
  # Headers need it, so programs that use an installed copy need not name a standard.
  target_compile_features(rtsg_${name} PUBLIC cxx_std_23)
  target_include_directories(rtsg_${name} PUBLIC
    "$<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include>" "$<INSTALL_INTERFACE:include>"
    PRIVATE src)
  foreach(library IN LISTS ARG_INSIDES)
    target_include_directories(rtsg_${name} PRIVATE "${PROJECT_SOURCE_DIR}/${library}/src")
  endforeach()
  foreach(dependency IN LISTS ARG_DEPENDS)
    target_link_libraries(rtsg_${name} PUBLIC rtsg_${dependency})
  endforeach()
  target_link_libraries(rtsg_${name} PUBLIC ${ARG_LIBRARIES} PRIVATE ${ARG_PRIVATE_LIBRARIES} $<BUILD_INTERFACE:rtsg_options>)
  target_compile_options(rtsg_${name} PRIVATE ${ARG_OPTIONS})
  set(headers <algorithm> <functional> <memory> <string> <unordered_map> <vector> <glm/glm.hpp>)
  if(ARG_DEPENDS)
    list(APPEND headers <rtsg/core/scene.h> <rtsg/core/x3d.h>)
  endif()
  # All above the core begin alike: one copy serves those that are compiled alike.
  if(TARGET rtsg_documents AND NOT name STREQUAL "documents" AND NOT ARG_OPTIONS)
    rtsg_reuse_precompiled(rtsg_${name} rtsg_documents)
  else()
    rtsg_precompile(rtsg_${name} ${headers})
  endif()
  # Sources that are compiled together share their anonymous namespace: a helper that two of them have is an error, and wants one home.
  set_target_properties(rtsg_${name} PROPERTIES UNITY_BUILD ${RTSG_PCH} UNITY_BUILD_MODE GROUP)
endfunction()

# Where modules are installed.
include(GNUInstallDirs)
set(RTSG_MODULE_DIR "${CMAKE_INSTALL_LIBDIR}/rtsg" CACHE INTERNAL "Where modules are installed")

# rtsg_module(NAME FOR LIBRARY SOURCES FILE... LIBRARIES LIBRARY...): librtsg_NAME.so, which LIBRARY loads when it is first needed
# (rtsg/core/module.h).
function(rtsg_module name)
  cmake_parse_arguments(ARG "" "FOR" "SOURCES;LIBRARIES" ${ARGN})
  add_library(rtsg_${name} MODULE ${ARG_SOURCES})
  set_target_properties(rtsg_${name} PROPERTIES LINKER_LANGUAGE CXX LIBRARY_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}"
                                                CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
  target_link_options(rtsg_${name} PRIVATE "-Wl,--version-script=${PROJECT_SOURCE_DIR}/cmake/module.map")
  target_include_directories(rtsg_${name} PRIVATE src "${PROJECT_SOURCE_DIR}/core/include")
  target_link_libraries(rtsg_${name} PRIVATE ${ARG_LIBRARIES} rtsg_options)
  list(LENGTH ARG_SOURCES count)
  if(RTSG_PCH AND count GREATER 1)
    set_target_properties(rtsg_${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
  endif()
  if(RTSG_MODULES)
    add_dependencies(rtsg_${ARG_FOR} rtsg_${name})
  else()
    set_target_properties(rtsg_${name} PROPERTIES EXCLUDE_FROM_ALL ON)
  endif()
  set_property(GLOBAL APPEND PROPERTY RTSG_MODULE_TARGETS rtsg_${name})
endfunction()
