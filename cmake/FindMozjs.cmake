# SpiderMonkey 102 (ECMAScript): target Mozjs::Mozjs. Its headers count as system headers.
include(FindPackageHandleStandardArgs)
find_path(Mozjs_INCLUDE_DIR jsapi.h PATH_SUFFIXES mozjs-102)
find_library(Mozjs_LIBRARY mozjs-102)
find_package_handle_standard_args(Mozjs REQUIRED_VARS Mozjs_LIBRARY Mozjs_INCLUDE_DIR)
if(Mozjs_FOUND AND NOT TARGET Mozjs::Mozjs)
  add_library(Mozjs::Mozjs UNKNOWN IMPORTED)
  set_target_properties(Mozjs::Mozjs PROPERTIES IMPORTED_LOCATION "${Mozjs_LIBRARY}"
                                                INTERFACE_INCLUDE_DIRECTORIES "${Mozjs_INCLUDE_DIR}")
endif()
