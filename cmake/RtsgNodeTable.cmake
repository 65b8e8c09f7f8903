# rtsg_node_table(TARGET [NAMESPACE ns] [HEADER name.h] TABLE.x3dspec...): compiles a user's own node tables (notation:
# the README beside the standard's tables) into TARGET. The header (default TARGET_nodes.h) has a handle a field and
# `ns::nodeTypes()` (default namespace: TARGET) for Scene::defineType.
if(EXISTS "${CMAKE_CURRENT_LIST_DIR}/spec")
  set(RTSG_SPEC_DIR "${CMAKE_CURRENT_LIST_DIR}/spec")  # installed
else()
  set(RTSG_SPEC_DIR "${CMAKE_CURRENT_LIST_DIR}/../core/spec")
endif()
set_property(GLOBAL PROPERTY RTSG_SPEC_DIR "${RTSG_SPEC_DIR}")

function(rtsg_node_table target)
  cmake_parse_arguments(ARG "" "NAMESPACE;HEADER" "" ${ARGN})
  if(NOT ARG_NAMESPACE)
    set(ARG_NAMESPACE ${target})
  endif()
  if(NOT ARG_HEADER)
    set(ARG_HEADER ${target}_nodes.h)
  endif()
  get_property(spec_dir GLOBAL PROPERTY RTSG_SPEC_DIR)
  file(GLOB standard "${spec_dir}/*.x3dspec")
  set(imports)
  foreach(table IN LISTS standard)
    list(APPEND imports --import "${table}")
  endforeach()
  set(tables)
  foreach(table IN LISTS ARG_UNPARSED_ARGUMENTS)
    get_filename_component(table "${table}" ABSOLUTE)
    list(APPEND tables "${table}")
  endforeach()
  set(folder "${CMAKE_CURRENT_BINARY_DIR}/${target}_node_table")
  get_filename_component(header "${folder}/${ARG_HEADER}" ABSOLUTE)
  set(source "${folder}/${target}_node_table.cpp")
  get_filename_component(header_folder "${header}" DIRECTORY)
  file(MAKE_DIRECTORY "${header_folder}")
  add_custom_command(
    OUTPUT "${header}" "${source}"
    COMMAND rtsg::spec_compiler ${imports} --namespace ${ARG_NAMESPACE} --include "${header}" --header "${header}"
            --source "${source}" ${tables}
    DEPENDS rtsg::spec_compiler ${standard} ${tables}
    COMMENT "Compiling the node tables of ${target}" VERBATIM)
  target_sources(${target} PRIVATE "${header}" "${source}")
  target_include_directories(${target} PUBLIC "$<BUILD_INTERFACE:${folder}>")
endfunction()
