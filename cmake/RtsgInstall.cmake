# Install rules: libraries, headers, the program, and what find_package(rtsg) needs.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

install(TARGETS rtsg_core rtsg_documents rtsg_scripts rtsg_renderers rtsg_audio rtsg_sync rtsg_physics rtsg_dis rtsg_window rtsg_haptics EXPORT rtsgTargets)
install(TARGETS rtsg EXPORT rtsgTargets RUNTIME)
if(RTSG_IMAGES)
  install(TARGETS rtsg_images rtsg_plain LIBRARY DESTINATION "${RTSG_MODULE_DIR}")
  foreach(module exr webp)
    if(TARGET rtsg_${module})
      install(TARGETS rtsg_${module} LIBRARY DESTINATION "${RTSG_MODULE_DIR}")
    endif()
  endforeach()
endif()
if(RTSG_MOVIES)
  install(TARGETS rtsg_movies LIBRARY DESTINATION "${RTSG_MODULE_DIR}")
endif()
if(RTSG_FONTS)
  install(TARGETS rtsg_fonts LIBRARY DESTINATION "${RTSG_MODULE_DIR}")
endif()
if(TARGET rtsg_netcdf)
  install(TARGETS rtsg_netcdf LIBRARY DESTINATION "${RTSG_MODULE_DIR}")
endif()
if(TARGET rtsg_sdl)
  install(TARGETS rtsg_sdl LIBRARY DESTINATION "${RTSG_MODULE_DIR}")
endif()
if(RTSG_WEB)
  install(TARGETS rtsg_web LIBRARY DESTINATION "${RTSG_MODULE_DIR}")
  # The page, and what `./dev web` has fetched for it, if it has.
  foreach(folder page src node_modules/hash-wasm/dist node_modules/x_ite/dist)
    install(DIRECTORY "${PROJECT_SOURCE_DIR}/sync/js/${folder}/" DESTINATION "${CMAKE_INSTALL_DATADIR}/rtsg/web/${folder}"
            OPTIONAL PATTERN "*.zip" EXCLUDE PATTERN "*.d.ts" EXCLUDE PATTERN "x_ite.js" EXCLUDE PATTERN "x_ite.mjs" EXCLUDE)
  endforeach()
endif()
install(TARGETS spec_compiler EXPORT rtsgTargets RUNTIME DESTINATION "${CMAKE_INSTALL_LIBEXECDIR}/rtsg")
foreach(folder core documents scripts renderers audio sync physics dis window haptics)
  install(DIRECTORY "${PROJECT_SOURCE_DIR}/${folder}/include/" TYPE INCLUDE)
endforeach()
install(DIRECTORY "${PROJECT_BINARY_DIR}/core/generated/rtsg" TYPE INCLUDE FILES_MATCHING PATTERN "*.h")
install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DOCDIR}")

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
