# Language level, warnings, instruction set and sanitizers: everything that must be alike in all targets.
set(CMAKE_CXX_STANDARD 23)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
# Where programs in the build folder, and those below it, find modules that are loaded when needed.
set(CMAKE_BUILD_RPATH "${CMAKE_BINARY_DIR}")
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}")
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY OFF)
set(CMAKE_FIND_PACKAGE_TARGETS_GLOBAL ON)

option(RTSG_TESTS "Build the tests" ON)
# Parts that a build can leave out; what would need them says so at run time.
option(RTSG_SCRIPTS "Run Script nodes (SpiderMonkey)" ON)
option(RTSG_SOUND_DEVICE "Stereo and binaural sound (OpenAL)" ON)
option(RTSG_SOFA "SOFA files: heads (libmysofa) and responses of rooms (netCDF), where these are there" ON)
option(RTSG_IMAGES "Read and write image files (OpenImageIO)" ON)
option(RTSG_MOVIES "Show films (FFmpeg's libraries)" ON)
option(RTSG_FONTS "Draw Text (FreeType, fontconfig; HarfBuzz where it is there)" ON)
option(RTSG_PHYSICS "Rigid bodies (ODE, where it is there)" ON)
option(RTSG_WEB "Serve browsers (Boost.Beast)" ON)
option(RTSG_WINDOW "A window to look into scenes with (SDL 2, where it is there)" ON)
option(RTSG_OVERLAY "Figures, nodes and a time line over the window's picture (Dear ImGui, where it is there)" ON)
option(RTSG_BENCH "rtsg bench and rtsg chart" ON)
if(RTSG_TESTS AND NOT (RTSG_SCRIPTS AND RTSG_SOUND_DEVICE AND RTSG_IMAGES AND RTSG_MOVIES AND RTSG_FONTS AND RTSG_WEB AND RTSG_BENCH))
  message(FATAL_ERROR "The tests need every part: leave parts out together with -DRTSG_TESTS=OFF")
endif()
# For builds from nothing (./dev takes it where there is no ccache): who edits headers waits longer with it, as every object depends on what
# it holds.
option(RTSG_PCH "Compile the headers that most sources include once a target, and the libraries' sources several at a time" OFF)
option(RTSG_WERROR "Treat warnings as errors" OFF)
option(RTSG_FUZZ "Build the libFuzzer targets (clang only)" OFF)
set(RTSG_ARCH "x86-64-v3" CACHE STRING "Value of -march; empty for the compiler's default")
set(RTSG_SANITIZE "" CACHE STRING "Value of -fsanitize for every target")
set(RTSG_SANITIZE_NOT "" CACHE STRING "Value of -fno-sanitize beside it")

add_library(rtsg_options INTERFACE)
# Of sources that are compiled together a local name shadows nothing that a neighbour has at its top level.
set(shadow -Wshadow)
if(RTSG_PCH)
  set(shadow "$<$<CXX_COMPILER_ID:GNU>:-Wshadow=local>")
endif()
target_compile_options(rtsg_options INTERFACE -Wall -Wextra -Wpedantic ${shadow} -Wnon-virtual-dtor -Wold-style-cast)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  target_compile_options(rtsg_options INTERFACE -Wno-restrict)  # false alarms on std::string + (GCC bug 105651)
endif()
if(RTSG_PCH AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # Of sources that are compiled together GCC 12 (the same bug) and 14 warn of sizes that cannot occur. Builds without RTSG_PCH still look.
  target_compile_options(rtsg_options INTERFACE -Wno-stringop-overflow -Wno-stringop-overread -Wno-array-bounds)
endif()
if(RTSG_PCH AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # Of anonymous namespaces in sources that are compiled together GCC thinks that they stand in a header.
  target_compile_options(rtsg_options INTERFACE -Wno-subobject-linkage)
endif()
if(RTSG_WERROR)
  target_compile_options(rtsg_options INTERFACE -Werror)
endif()
if(RTSG_ARCH)
  add_compile_options(-march=${RTSG_ARCH})
endif()
# Bit-exact replicas need the same arithmetic everywhere: no contraction into fused multiply-adds.
add_compile_options(-ffp-contract=off)
if(RTSG_SANITIZE)
  add_compile_options(-fsanitize=${RTSG_SANITIZE} -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${RTSG_SANITIZE})
  if(RTSG_SANITIZE_NOT)
    add_compile_options(-fno-sanitize=${RTSG_SANITIZE_NOT})
  endif()
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # What the sanitizers add makes GCC believe that members of std::function are never set; and fences of libraries, which
    # ThreadSanitizer does not know, are no fault of ours. Builds without sanitizers still look.
    target_compile_options(rtsg_options INTERFACE -Wno-maybe-uninitialized -Wno-tsan)
  endif()
endif()

# rtsg_precompile(TARGET <header>...): with RTSG_PCH, the target's sources start with these headers. Sources still name what they use:
# builds without RTSG_PCH, which is the default of CMake, would fail otherwise.
function(rtsg_precompile target)
  if(RTSG_PCH)
    target_precompile_headers(${target} PRIVATE ${ARGN})
  endif()
endfunction()
