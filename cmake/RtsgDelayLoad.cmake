# rtsg_delay_load(NAME FOR LIBRARY NEED TEXT SYMBOLS REGEX LIBRARIES LIBRARY... [DATA SYMBOL...]): LIBRARY of ours calls LIBRARIES of others
# as if it were linked with them, and they are loaded by the first call (rtsg/core/module.h). Makes librtsg_NAME.so, the module that
# is linked with them, and rtsg_NAME_stubs, which sources link in their stead. SYMBOLS says which of their functions have stubs, and DATA
# which of their values are copied; TEXT begins the report that the module is missing ("scripts need"). Sources declare
# `namespace rtsg::delayed { extern DelayedLibrary NAME; }`.
option(RTSG_DELAY_LOAD "Load large libraries of others when they are first needed" ON)
set(RTSG_STUBS OFF)
if(RTSG_DELAY_LOAD AND CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64|aarch64)$")
  set(RTSG_STUBS ON)
endif()

if(RTSG_STUBS)
  enable_language(ASM)
endif()

function(rtsg_delay_load name)
  cmake_parse_arguments(ARG "" "FOR;NEED;SYMBOLS" "LIBRARIES;DATA" ${ARGN})
  set(files)
  foreach(library IN LISTS ARG_LIBRARIES)
    if(TARGET ${library})
      list(APPEND files "$<TARGET_FILE:${library}>")
      # What their headers need, which linking would have brought.
      target_include_directories(rtsg_${ARG_FOR} SYSTEM PRIVATE "$<TARGET_PROPERTY:${library},INTERFACE_INCLUDE_DIRECTORIES>")
      target_compile_definitions(rtsg_${ARG_FOR} PRIVATE "$<TARGET_PROPERTY:${library},INTERFACE_COMPILE_DEFINITIONS>")
    elseif(IS_ABSOLUTE "${library}")
      list(APPEND files "${library}")
    else()
      find_library(RTSG_FILE_${library} ${library} REQUIRED)
      mark_as_advanced(RTSG_FILE_${library})
      list(APPEND files "${RTSG_FILE_${library}}")
    endif()
  endforeach()
  set(made "${CMAKE_CURRENT_BINARY_DIR}/generated/${name}")
  set(machine none)
  set(outputs "${made}_library.cpp")
  if(RTSG_STUBS)
    set(machine "${CMAKE_SYSTEM_PROCESSOR}")
    list(APPEND outputs "${made}_stubs.s" "${made}_table.s")
  endif()
  add_custom_command(
    OUTPUT ${outputs}
    COMMAND "${CMAKE_COMMAND}" "-DNAME=${name}" "-DMACHINE=${machine}" "-DNM=${CMAKE_NM}" "-DFILES=${files}" "-DSYMBOLS=${ARG_SYMBOLS}"
            "-DDATA=${ARG_DATA}" "-DNEED=${ARG_NEED}" "-DLIBRARY=${made}_library.cpp" "-DSTUBS=${made}_stubs.s" "-DTABLE=${made}_table.s"
            -P "${PROJECT_SOURCE_DIR}/cmake/delay_load.cmake"
    DEPENDS "${PROJECT_SOURCE_DIR}/cmake/delay_load.cmake" ${files}
    COMMENT "Making stubs of ${name}" VERBATIM)
  list(FILTER outputs EXCLUDE REGEX "_table.s$")
  add_library(rtsg_${name}_stubs STATIC ${outputs})
  set_target_properties(rtsg_${name}_stubs PROPERTIES EXPORT_NAME ${name}_stubs POSITION_INDEPENDENT_CODE ON)
  target_link_libraries(rtsg_${name}_stubs PUBLIC rtsg_core PRIVATE $<BUILD_INTERFACE:rtsg_options>)
  target_link_libraries(rtsg_${ARG_FOR} PRIVATE rtsg_${name}_stubs)
  set_property(GLOBAL APPEND PROPERTY RTSG_STUB_TARGETS rtsg_${name}_stubs)
  if(RTSG_STUBS)
    rtsg_module(${name} FOR ${ARG_FOR} SOURCES "${made}_table.s" LIBRARIES ${ARG_LIBRARIES})
    add_dependencies(rtsg_${name} rtsg_${name}_stubs)
    foreach(target rtsg_${name} rtsg_${name}_stubs)  # what clang has no use for when it assembles
      target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:ASM>:-Wno-unused-command-line-argument>)
    endforeach()
  else()
    target_link_libraries(rtsg_${name}_stubs PUBLIC ${ARG_LIBRARIES})
  endif()
endfunction()
