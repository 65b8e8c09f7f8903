// LiveSound: what the listener of a running scene hears, now, from a sound device.
//
//     auto live = LiveSound::start(world, {});      // on the scene's thread, which then runs frames as it does
//     ...                                           // scene.newFrame(t)
//     const LiveReport report = (*live)->stop();
//
// A thread of its own renders blocks as the device takes them, from the newest state of the world; rooms are traced on
// one more. Neither waits for the scene, nor the scene for them. Places follow the scene's time; what comes late or
// early by less than a tenth of a second is heard as if it came evenly. Invariant: a device that got no block in time
// is an underrun, counted. Threading: start(), sendEvents(), stop() and the destructor on the scene's thread; report()
// from any.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <rtsg/audio/acoustic_engine.h>
#include <rtsg/renderers/shared_world.h>

namespace rtsg {

struct LiveOptions {
    AcousticOptions render;
    std::string device;      // empty: the default one
    std::size_t blocks = 6;  // that wait at most in front of the device
};

struct LiveReport {
    std::string device;
    double seconds = 0;         // played
    double latencySeconds = 0;  // from rendering to hearing, the largest seen
    double busy = 0;            // share of the time that its thread needs
    double level = 0;           // of what plays, root mean square of both channels over the last fifth of a second
    std::uint64_t blocks = 0, underruns = 0;
    std::uint64_t clipped = 0;  // samples beyond full scale, of both channels, which a device plays as 1
    HeardResponses heard;
    std::string failure;  // why it plays no longer; empty while it does
    Diagnostics diagnostics;
};

class LiveSound {
  public:
    /// The world must outlive this. Errors: no device, or one that cannot be used.
    static Result<std::unique_ptr<LiveSound>> start(SharedWorld& world, const LiveOptions& options);
    ~LiveSound();

    /// Sends what nodes find in the sound, as SoundRenderer::sendEvents() does, since it was last called; waits for
    /// nothing.
    void sendEvents();
    LiveReport report() const;
    /// Ends the sound.
    LiveReport stop();

  private:
    struct Impl;
    explicit LiveSound(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
