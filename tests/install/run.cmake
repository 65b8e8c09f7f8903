# Installs the build into a scratch folder, configures and builds the consumer there, and runs it.
file(REMOVE_RECURSE "${WORK}")
function(step)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "${ARGN}\n${output}")
  endif()
endfunction()
step("${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${WORK}/prefix")
step("${CMAKE_COMMAND}" -G "${GENERATOR}" "-DCMAKE_CXX_COMPILER=${COMPILER}" -S "${SOURCE}/tests/install" -B "${WORK}/build" "-DCMAKE_PREFIX_PATH=${WORK}/prefix" ${FLAGS})
step("${CMAKE_COMMAND}" --build "${WORK}/build")
step("${WORK}/build/consumer")

# The project that the docs show, with the example that they show below it.
file(READ "${SOURCE}/docs/getting-started.md" page)
string(FIND "${page}" "cmake_minimum_required" begin)
string(SUBSTRING "${page}" ${begin} -1 project)
string(FIND "${project}" "\n```\n" end)
string(SUBSTRING "${project}" 0 ${end} project)
file(WRITE "${WORK}/shown/CMakeLists.txt" "${project}")
configure_file("${SOURCE}/examples/02_render_picture.cpp" "${WORK}/shown/mine.cpp" COPYONLY)
step("${CMAKE_COMMAND}" -G "${GENERATOR}" "-DCMAKE_CXX_COMPILER=${COMPILER}" -S "${WORK}/shown" -B "${WORK}/shown/build" "-DCMAKE_PREFIX_PATH=${WORK}/prefix" ${FLAGS})
step("${CMAKE_COMMAND}" --build "${WORK}/shown/build")

# The man page is that of this program, whichever targets were built.
execute_process(COMMAND "${WORK}/prefix/bin/rtsg" help --man OUTPUT_FILE "${WORK}/rtsg.1")
step("${CMAKE_COMMAND}" -E compare_files "${WORK}/rtsg.1" "${WORK}/prefix/share/man/man1/rtsg.1")
step("${CMAKE_CTEST_COMMAND}" --test-dir "${WORK}/build" --output-on-failure --no-tests=error)

# Libraries that the first call loads: the program says what is missing without them.
file(WRITE "${WORK}/script.x3dv" "#X3D V4.0 utf8\nPROFILE Full\nScript { url \"ecmascript: function initialize() { print('here'); }\" }\n")
file(WRITE "${WORK}/polygon.x3dv" "#X3D V4.0 utf8\nPROFILE Full\nShape { geometry IndexedFaceSet { convex FALSE coordIndex [0 1 2 3 4]
  coord Coordinate { point [0 1 0, .59 -.81 0, -.95 .31 0, .95 .31 0, -.59 -.81 0] } } }\n")
file(WRITE "${WORK}/bodies.x3dv" "#X3D V4.0 utf8\nPROFILE Full\nRigidBodyCollection { bodies RigidBody { } }\n")
function(expect_missing module)
  file(GLOB_RECURSE file "${WORK}/prefix/*/librtsg_${module}.so")
  if(NOT file)
    return()  # a build that links it
  endif()
  file(RENAME "${file}" "${file}.away")
  execute_process(COMMAND "${CMAKE_COMMAND}" -E env --unset=LD_LIBRARY_PATH "${WORK}/prefix/bin/rtsg" ${ARGN} TIMEOUT 60 RESULT_VARIABLE result
                  OUTPUT_VARIABLE output ERROR_VARIABLE output)
  file(RENAME "${file}.away" "${file}")
  if(NOT result MATCHES "^[01]$" OR NOT output MATCHES "librtsg_${module}.so")
    message(FATAL_ERROR "without ${module}: status ${result}\n${output}")
  endif()
endfunction()
expect_missing(mozjs run "${WORK}/script.x3dv" --for 0.1s)
expect_missing(mozjs validate "${WORK}/script.x3dv")
expect_missing(glu info "${WORK}/polygon.x3dv")
expect_missing(embree render "${WORK}/polygon.x3dv" -o "${WORK}/polygon.png" --size 16x16)
expect_missing(ode run "${WORK}/bodies.x3dv" --for 0.1s)
expect_missing(zmq serve "${WORK}/script.x3dv" --bind "ipc://${WORK}/mirror" --for 0.1s)

# Image files come as modules, PNG files by one of their own: the installed program finds them, and says what is missing without them.
file(WRITE "${WORK}/box.x3dv" "#X3D V4.0 utf8\nPROFILE Interchange\nShape { geometry Box { } }\n")
set(render "${WORK}/prefix/bin/rtsg" render "${WORK}/box.x3dv" --size 16x16 -o)
set(modules images.tif plain.png)
foreach(module exr webp)  # of builds that found their libraries' headers
  if(EXISTS "${BUILD}/librtsg_${module}.so")
    list(APPEND modules ${module}.${module})
  endif()
endforeach()
foreach(pair IN LISTS modules)
  string(REPLACE "." ";" pair "${pair}")
  list(GET pair 0 module)
  list(GET pair 1 extension)
  step(${render} "${WORK}/box.${extension}")
  file(GLOB_RECURSE file "${WORK}/prefix/*/librtsg_${module}.so")
  file(REMOVE "${file}")
  # Not that of the build folder, which a sanitizer's run names.
  execute_process(COMMAND "${CMAKE_COMMAND}" -E env --unset=LD_LIBRARY_PATH ${render} "${WORK}/none.${extension}" RESULT_VARIABLE result ERROR_VARIABLE output)
  if(NOT result EQUAL 1 OR NOT output MATCHES "librtsg_${module}.so" OR EXISTS "${WORK}/none.${extension}")
    message(FATAL_ERROR "without ${module}: status ${result}\n${output}")
  endif()
endforeach()
step("${WORK}/prefix/bin/rtsg" info "${WORK}/box.x3dv")

# A plug-in, built as a stranger builds it, and loaded by the installed program.
step("${CMAKE_COMMAND}" -G "${GENERATOR}" "-DCMAKE_CXX_COMPILER=${COMPILER}" -S "${SOURCE}/examples/plugin" -B "${WORK}/plugin" "-DCMAKE_PREFIX_PATH=${WORK}/prefix" ${FLAGS})
step("${CMAKE_COMMAND}" --build "${WORK}/plugin")
step("${WORK}/prefix/bin/rtsg" info "${SOURCE}/examples/plugin/spinner.x3dv" --plugin "${WORK}/plugin/workshop.so")
