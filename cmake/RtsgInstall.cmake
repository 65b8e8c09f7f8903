# Install rules: libraries, headers, the program, and what find_package(rtsg) needs.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(RTSG_LIBRARIES core documents scripts renderers audio sync feeds fetch physics dis window haptics ogre nats plugins)
list(TRANSFORM RTSG_LIBRARIES PREPEND rtsg_ OUTPUT_VARIABLE library_targets)
install(TARGETS ${library_targets} EXPORT rtsgTargets COMPONENT libraries)
if(NOT BUILD_SHARED_LIBS)
  get_property(stub_targets GLOBAL PROPERTY RTSG_STUB_TARGETS)
  install(TARGETS ${stub_targets} EXPORT rtsgTargets COMPONENT libraries)
endif()
add_custom_target(rtsg_libraries DEPENDS ${library_targets})
# pkg-config names one by one those that are asked for; static libraries need their own libraries too, which find_package knows.
if(BUILD_SHARED_LIBS)
  file(RELATIVE_PATH RTSG_PC_PREFIX "/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/")
  list(JOIN RTSG_LIBRARIES "|" one_of_ours)
  foreach(RTSG_PC_NAME IN LISTS RTSG_LIBRARIES)
    get_target_property(linked rtsg_${RTSG_PC_NAME} INTERFACE_LINK_LIBRARIES)
    list(FILTER linked INCLUDE REGEX "^rtsg_(${one_of_ours})$")
    list(TRANSFORM linked REPLACE "^rtsg_" "rtsg-")
    list(JOIN linked ", " RTSG_PC_REQUIRES)
    configure_file(cmake/rtsg.pc.in "${PROJECT_BINARY_DIR}/rtsg-${RTSG_PC_NAME}.pc" @ONLY)
    install(FILES "${PROJECT_BINARY_DIR}/rtsg-${RTSG_PC_NAME}.pc" DESTINATION "${CMAKE_INSTALL_LIBDIR}/pkgconfig")
  endforeach()
endif()
install(TARGETS rtsg_plugin EXPORT rtsgTargets)  # what plug-ins are compiled with
install(TARGETS rtsg EXPORT rtsgTargets RUNTIME)
get_property(module_targets GLOBAL PROPERTY RTSG_MODULE_TARGETS)
install(TARGETS ${module_targets} LIBRARY DESTINATION "${RTSG_MODULE_DIR}")
if(RTSG_WEB)
  # The page, and what `./dev web` has fetched for it, if it has.
  foreach(folder page src node_modules/hash-wasm/dist node_modules/x_ite/dist)
    install(DIRECTORY "${PROJECT_SOURCE_DIR}/sync/js/${folder}/" DESTINATION "${CMAKE_INSTALL_DATADIR}/rtsg/web/${folder}"
            OPTIONAL PATTERN "*.zip" EXCLUDE PATTERN "*.d.ts" EXCLUDE PATTERN "x_ite.js" EXCLUDE PATTERN "x_ite.mjs" EXCLUDE)
  endforeach()
endif()
install(TARGETS spec_compiler EXPORT rtsgTargets RUNTIME DESTINATION "${CMAKE_INSTALL_LIBEXECDIR}/rtsg")
foreach(folder IN LISTS RTSG_LIBRARIES)
  install(DIRECTORY "${PROJECT_SOURCE_DIR}/${folder}/include/" TYPE INCLUDE)
endforeach()
install(DIRECTORY "${PROJECT_BINARY_DIR}/core/generated/rtsg" TYPE INCLUDE FILES_MATCHING PATTERN "*.h")
install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DOCDIR}")

# Components whose libraries are there, and say at run time that the build has left out what they are for. find_package() does not find them.
set(RTSG_LEFT_OUT "")
foreach(part "scripts=rtsg_mozjs_stubs=SpiderMonkey" "physics=rtsg_ode_stubs=ODE" "window=rtsg_sdl=SDL 2" "ogre=rtsg_ogre_module=OGRE" "nats=rtsg_nats_module=libnats" "fetch=rtsg_curl=libcurl")
  string(REPLACE "=" ";" part "${part}")
  list(GET part 0 component)
  list(GET part 1 target)
  list(GET part 2 library)
  if(NOT TARGET ${target})
    list(APPEND RTSG_LEFT_OUT "${component}=${library}")
  endif()
endforeach()

set(destination "${CMAKE_INSTALL_LIBDIR}/cmake/rtsg")
install(EXPORT rtsgTargets NAMESPACE rtsg:: DESTINATION "${destination}")
configure_package_config_file(cmake/rtsgConfig.cmake.in "${PROJECT_BINARY_DIR}/rtsgConfig.cmake"
                              INSTALL_DESTINATION "${destination}")
write_basic_package_version_file("${PROJECT_BINARY_DIR}/rtsgConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
install(DIRECTORY "${PROJECT_SOURCE_DIR}/core/spec" DESTINATION "${destination}")
install(FILES "${PROJECT_BINARY_DIR}/rtsgConfig.cmake" "${PROJECT_BINARY_DIR}/rtsgConfigVersion.cmake"
              "${PROJECT_SOURCE_DIR}/cmake/RtsgNodeTable.cmake"
              "${PROJECT_SOURCE_DIR}/cmake/FindMozjs.cmake"
              "${PROJECT_SOURCE_DIR}/cmake/RtsgReplayTest.cmake"
        DESTINATION "${destination}")
