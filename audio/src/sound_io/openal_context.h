// Makes an OpenAL context current on one thread for the calls of one scope, and sets the options that OpenAL reads when
// it opens the first device.
//
// Needs ALC_EXT_thread_local_context. Threading: as the owner of the context.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <string>
#include <string_view>

#define AL_ALEXT_PROTOTYPES
#include <AL/al.h>
#include <AL/alc.h>
#include <AL/alext.h>

#include <rtsg/core/module.h>

namespace rtsg::delayed {
extern DelayedLibrary openal;
}

namespace rtsg {

/// Makes a context the thread's current one, and puts back the one before.
class BoundContext {
  public:
    explicit BoundContext(ALCcontext* context) : before_(alcGetThreadContext()) { alcSetThreadContext(context); }
    ~BoundContext() { alcSetThreadContext(before_); }
    BoundContext(const BoundContext&) = delete;
    BoundContext& operator=(const BoundContext&) = delete;

  private:
    ALCcontext* before_;
};

/// Lets devices use short periods: OpenAL Soft's default is three of 21 ms, and a file is the only way to change it.
/// Hold it while a device is opened. A file named in ALSOFT_CONF takes precedence.
class ShortPeriods {
  public:
    ShortPeriods() {
        static std::atomic<bool> reported = false;
        if (reported.exchange(true) || std::getenv("ALSOFT_CONF")) return;
        constexpr std::string_view kSettings = "[general]\nfrequency = 48000\nperiod_size = 256\nperiods = 3\n";
        file_ = memfd_create("openal", MFD_CLOEXEC);
        if (file_ < 0 || ::write(file_, kSettings.data(), kSettings.size()) < 0) return;
        named_ = ::setenv("ALSOFT_CONF", ("/proc/self/fd/" + std::to_string(file_)).c_str(), 1) == 0;
    }
    ~ShortPeriods() {
        if (named_) ::unsetenv("ALSOFT_CONF");
        if (file_ >= 0) ::close(file_);
    }
    ShortPeriods(const ShortPeriods&) = delete;
    ShortPeriods& operator=(const ShortPeriods&) = delete;

  private:
    int file_ = -1;
    bool named_ = false;
};

}  // namespace rtsg
