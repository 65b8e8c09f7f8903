// SoundDevice: what is heard now: two channels, block by block, to OpenAL's output.
//
// Whoever writes is paced by the device: free() blocks may be written at any time; a device that ran out of them has
// had an underrun, which is counted, and goes on with the next. OpenAL Soft's back ends apply (ALSOFT_DRIVERS=null
// plays in time and silently, wave into a file). Threading: one thread an object; the context is bound to it only while
// a call lasts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

class SoundDevice {
  public:
    struct Options {
        std::string name = {};  // empty: the default device
        int sampleRate = 48000;
        std::size_t blockSize = 256;
        std::size_t blocks = 6;  // that wait at most: 32 ms
    };

    /// Errors: no such device, or a build without OpenAL.
    static Result<SoundDevice> open(const Options& options);
    ~SoundDevice();
    SoundDevice(SoundDevice&&) noexcept;
    SoundDevice& operator=(SoundDevice&&) noexcept;

    /// Blocks that could be written now.
    std::size_t free();
    /// One block, interleaved. Precondition: free() > 0.
    Result<> write(std::span<const float> stereo);
    std::uint64_t underruns() const;
    /// From writing to hearing: what waits here and what the device says of itself, seconds.
    double latencySeconds() const;
    const std::string& name() const;

  private:
    struct Impl;
    explicit SoundDevice(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
