// Modules: parts that need large libraries and are loaded on first use, so that programs without them start at once.
//
// A module is found by its name, along the program's run path and LD_LIBRARY_PATH. It stays until the process ends.
// Threading: any thread.
#pragma once

#include <string_view>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

/// The address of `symbol` in lib`name`.so; a module's symbols carry the number of their interface in their names.
/// Errors: no such module ("films need the module ... (Debian package ...)", for the `need` "films need"); a module of
/// another version.
Result<void*> loadModule(const char* name, const char* symbol, std::string_view need);

}  // namespace rtsg
