// Libraries of others that are loaded when they are first needed, so that programs without them start at once.
//
// rtsg_delay_load (cmake/RtsgDelayLoad.cmake) makes two things of such a library: a module, which is linked with it and
// holds the addresses of its functions, and stubs of the same names, through which sources call it as if it were
// linked. The first call loads the module. Whoever can report that it is not there calls load() before, since a stub
// can only end the process. Where stubs cannot be made, the library is linked as usual, and load() has nothing to do.
//
// Threading: any thread.
#pragma once

#include <atomic>
#include <cstddef>
#include <mutex>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

class DelayedLibrary {
  public:
    /// Values of the library, and the copies of them that sources see.
    struct Data {
        void* copy;
        std::size_t bytes;
    };
    /// What the stubs have: the names of the module and of its table, what it is needed for ("scripts need"), where the
    /// stubs jump to, and copies. The table has the addresses of all functions, and then those of the data.
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

    /// Loads it, once. Errors: no such module ("scripts need the module ..."); a module of another version.
    Result<> load();
    /// Whether the process is in exit(), and the library's static data may be gone: nothing of it may be called.
    bool hasEnded() const { return ended_; }
    void* function(std::size_t index) const { return stubs_.functions[index]; }

  private:
    Result<> fill();

    Stubs stubs_;
    std::once_flag once_;
    const Diagnostic* error_ = nullptr;  // kept for ever, as static objects may ask when all else is gone
    std::atomic<bool> ended_ = false;
};

}  // namespace rtsg
