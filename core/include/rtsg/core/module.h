// Modules: parts that need large libraries and are loaded on first use, so that programs without them start at once.
//
// A module is found by its name, along the program's run path and LD_LIBRARY_PATH. It stays until the process ends.
// Threading: any thread.
#pragma once

#include <atomic>
#include <cstddef>
#include <mutex>
#include <string_view>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

/// The address of `symbol` in lib`name`.so; a module's symbols carry the number of their interface in their names.
/// Errors: no such module ("films need the module ... (Debian package ...)", for the `need` "films need"); a module of
/// another version.
Result<void*> loadModule(const char* name, const char* symbol, std::string_view need);

/// Another project's library that is loaded on the first call. rtsg_delay_load (cmake/RtsgDelayLoad.cmake) makes two
/// things of it: a module, which is linked with the library and holds the addresses of its functions, and stubs of the
/// same names, through which sources call the library as if it were linked. The first call loads the module. A caller
/// that can report a missing module calls load() first; else the stub throws std::runtime_error with the same text.
/// Where stubs cannot be made, the library is linked as usual, and load() does nothing.
class DelayedLibrary {
  public:
    /// Variables of the library, and the copies of them that sources see.
    struct Data {
        void* copy;
        std::size_t bytes;
    };
    /// The data of the stubs: the names of the module and of its table, what needs the library ("scripts need"), the
    /// addresses that the stubs jump to, and copies. The table has the addresses of all functions, then those of the
    /// variables.
    struct Stubs {
        const char* module = nullptr;  // null: it is linked
        const char* table = nullptr;
        const char* need = nullptr;
        void** functions = nullptr;
        std::size_t functionCount = 0;
        const Data* data = nullptr;
        std::size_t dataCount = 0;
    };

    constexpr explicit DelayedLibrary(const Stubs& stubs) : stubs_(stubs) {}

    /// Loads the module, once. Errors: no such module ("scripts need the module ..."); a module of another version.
    Result<> load();
    /// Whether the process is in exit(), where the library's static data may be gone: then nothing of the library may
    /// be called.
    bool hasEnded() const { return ended_; }
    void* function(std::size_t index) const { return stubs_.functions[index]; }

  private:
    Result<> fill();

    Stubs stubs_;
    std::once_flag once_;
    const Diagnostic* error_ = nullptr;  // never destroyed, since static objects may ask for it after all else is gone
    std::atomic<bool> ended_ = false;
};

}  // namespace rtsg
