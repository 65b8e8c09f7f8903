# SpiderMonkey 128 or 102 (ECMAScript), the newest that is there: target Mozjs::Mozjs. Its headers count as system headers.
include(FindPackageHandleStandardArgs)
find_library(Mozjs_LIBRARY NAMES mozjs-128 mozjs-102)
string(REGEX MATCH "mozjs-[0-9]+" mozjs_name "${Mozjs_LIBRARY}")
find_path(Mozjs_INCLUDE_DIR jsapi.h PATH_SUFFIXES ${mozjs_name})
find_package_handle_standard_args(Mozjs REQUIRED_VARS Mozjs_LIBRARY Mozjs_INCLUDE_DIR)
if(Mozjs_FOUND AND NOT TARGET Mozjs::Mozjs)
  add_library(Mozjs::Mozjs UNKNOWN IMPORTED)
  set_target_properties(Mozjs::Mozjs PROPERTIES IMPORTED_LOCATION "${Mozjs_LIBRARY}"
                                                INTERFACE_INCLUDE_DIRECTORIES "${Mozjs_INCLUDE_DIR}")
endif()
