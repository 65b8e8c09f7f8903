// Finds and loads modules, and libraries with stubs.
#include <rtsg/core/module.h>

#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>

#include <cxxabi.h>
#include <dlfcn.h>

#include <fmt/format.h>

/// Which shared library this is, for what happens at its end.
extern void* __dso_handle;  // NOLINT(bugprone-reserved-identifier,readability-identifier-naming)

namespace rtsg {

namespace {

/// " (Debian package rtsg-window)" of rtsg_sdl; nothing of modules that are in none.
std::string packageOf(std::string_view name) {
    struct Row {
        std::string_view module, package;
    };
    static constexpr Row kRows[] = {
#include "module_packages.inc"
    };
    for (const Row& row : kRows)
        if (row.module == name) return fmt::format(" (Debian package {})", row.package);
    return {};
}

}  // namespace

Result<void*> loadModule(const char* name, const char* symbol, std::string_view need) {
    const std::string file = fmt::format("lib{}.so", name);
    void* module = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (!module) return fail(fmt::format("{} the module {}{}: {}", need, file, packageOf(name), ::dlerror()));
    void* found = ::dlsym(module, symbol);
    if (!found) return fail(fmt::format("the module {} belongs to another version of this program", file));
    return found;
}

Result<> DelayedLibrary::load() {
    std::call_once(once_, [this] {
        if (const auto filled = fill(); !filled) error_ = new Diagnostic(filled.error());
    });
    if (error_) return std::unexpected(*error_);
    return {};
}

Result<> DelayedLibrary::fill() {
    if (!stubs_.module) return {};
    const auto table = loadModule(stubs_.module, stubs_.table, stubs_.need);
    if (!table) return std::unexpected(table.error());
    void* const* const addresses = static_cast<void* const*>(*table);
    for (std::size_t i = 0; i < stubs_.dataCount; ++i)
        std::memcpy(stubs_.data[i].copy, addresses[stubs_.functionCount + i], stubs_.data[i].bytes);
    // Other threads call through them meanwhile.
    for (std::size_t i = 0; i < stubs_.functionCount; ++i)
        std::atomic_ref(stubs_.functions[i]).store(addresses[i], std::memory_order_release);
    // exit() calls registered functions from the last to the first. So this one is called before the library's static
    // data are destroyed, because the library registered them while it was loaded.
    abi::__cxa_atexit([](void* self) { static_cast<DelayedLibrary*>(self)->ended_ = true; }, this, &__dso_handle);
    return {};
}

}  // namespace rtsg

/// Stubs call this before their library is loaded; it returns the address of the function with this number. If the
/// library is missing, it throws: past the stub, as that has no result of its own to return. It has no namespace and
/// begins with rtsg_, so that shared libraries export it.
// NOLINTNEXTLINE(readability-identifier-naming)
extern "C" void* rtsg_first_call(rtsg::DelayedLibrary* library, std::size_t function) {
    if (const auto loaded = library->load(); !loaded) throw std::runtime_error(loaded.error().text);
    return library->function(function);
}
