// Finds and loads a module, and what it offers.
#include <rtsg/core/module.h>

#include <dlfcn.h>

#include <fmt/format.h>

namespace rtsg {

Result<void*> loadModule(const char* name, const char* symbol, std::string_view need) {
    const std::string file = fmt::format("lib{}.so", name);
    void* module = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (!module) return fail(fmt::format("{} the module {}: {}", need, file, ::dlerror()));
    void* found = ::dlsym(module, symbol);
    if (!found) return fail(fmt::format("the module {} belongs to another version of this program", file));
    return found;
}

}  // namespace rtsg
