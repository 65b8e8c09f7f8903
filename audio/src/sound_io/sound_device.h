// SoundDevice: plays two channels, block by block, on an OpenAL device.
//
// The device sets the pace: free() blocks may be written at any time. If it runs out of blocks, an underrun is counted,
// and it goes on with the next block. The back ends of OpenAL Soft can be chosen (ALSOFT_DRIVERS=null plays silently in
// real time, wave writes a file). Threading: one thread an object; the context is bound to the thread only during a
// call.
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
        std::size_t blocks = 6;  // the most that wait: 32 ms
    };

    /// Errors: there is no such device, or the build has no OpenAL.
    static Result<SoundDevice> open(const Options& options);
    ~SoundDevice();
    SoundDevice(SoundDevice&&) noexcept;
    SoundDevice& operator=(SoundDevice&&) noexcept;

    /// Number of blocks that can be written now.
    std::size_t free();
    /// One block, interleaved. Precondition: free() > 0.
    Result<> write(std::span<const float> stereo);
    std::uint64_t underruns() const;
    /// The time from writing to hearing, seconds: the waiting blocks and the latency that the device reports.
    double latencySeconds() const;
    const std::string& name() const;

  private:
    struct Impl;
    explicit SoundDevice(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
