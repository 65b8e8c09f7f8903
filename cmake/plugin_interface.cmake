# Writes OUTPUT, a header that names the interface of plug-ins: VERSION, and a number that follows from what the compiler sees of HEADERS, so
# that a comment more makes no other one.
cmake_minimum_required(VERSION 3.25)
set(all "")
foreach(header IN LISTS HEADERS)
  file(READ "${header}" text)
  string(REGEX REPLACE "//[^\n]*" "" text "${text}")
  string(REGEX REPLACE "[ \n]+" " " text "${text}")
  string(APPEND all "${text}")
endforeach()
string(SHA256 hash "${all}")
string(SUBSTRING "${hash}" 0 12 hash)
file(CONFIGURE OUTPUT "${OUTPUT}" CONTENT "// The interface that plug-ins are compiled with. Made by cmake/plugin_interface.cmake.
#pragma once

#define RTSG_PLUGIN_HEADERS \"@VERSION@-@hash@\"
" @ONLY)
