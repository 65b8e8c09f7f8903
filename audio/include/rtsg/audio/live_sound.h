// LiveSound: plays the sound of a running scene at once on a sound device.
//
//     auto live = LiveSound::start(world, {});      // on the scene's thread, which then runs frames as it does
//     ...                                           // scene.newFrame(t)
//     const LiveReport report = (*live)->stop();
//
// A thread of its own renders blocks when the device needs them, from the newest state of the world; another thread
// traces rooms. Neither waits for the scene, and the scene does not wait for them. Positions follow the scene's time;
// frames that are less than a tenth of a second late or early are evened out. Invariant: every block that the device
// did not get in time is counted as an underrun. Threading: start(), sendEvents(), stop() and the destructor on the
// scene's thread; report() on any.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <rtsg/audio/acoustic_renderer.h>
#include <rtsg/renderers/shared_world.h>

namespace rtsg {

struct LiveOptions {
    AcousticOptions render;
    std::string device;      // empty: the default device
    std::size_t blocks = 6;  // the most that wait for the device
};

struct LiveReport {
    std::string device;
    double seconds = 0;         // played
    double latencySeconds = 0;  // from rendering to hearing, the largest seen
    double busy = 0;            // share of the time that the rendering thread is busy
    double level = 0;           // of the output: root mean square of both channels over the last fifth of a second
    std::uint64_t blocks = 0, underruns = 0;
    std::uint64_t clipped = 0;  // samples of both channels beyond full scale, which the device limits to 1
    HeardResponses heard;
    std::string failure;  // the reason why it no longer plays; empty while it plays
    Diagnostics diagnostics;
};

class LiveSound {
  public:
    /// The world must outlive this object. Errors: there is no device, or it cannot be used.
    static Result<std::unique_ptr<LiveSound>> start(SharedWorld& world, const LiveOptions& options);
    ~LiveSound();

    /// Sends the results of Analysers and compressors since the last call, like SoundRenderer::sendEvents(). Does not
    /// wait.
    void sendEvents();
    LiveReport report() const;
    /// How loud it plays from the next block on: 0 is silent, 1 as it is heard in the scene. It counts in `level`.
    void setVolume(double volume);
    /// Stops playing.
    LiveReport stop();

  private:
    struct Impl;
    explicit LiveSound(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
