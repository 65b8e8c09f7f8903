// Feed: reads events for a scene from outside, as lines of JSON or CSV: from a pipe, a file, sockets, or an MQTT
// broker.
//
// A line is {"node":"DOOR","field":"translation","value":[1,0,0]}, optionally with "t" and "author", as `rtsg run
// --watch` prints it; or CSV. Events go into the next frame. For a field that has a value, each frame takes the newest
// one; an inputOnly field gets one event in a frame, and the others wait for later frames. Invariant: for any input,
// memory is bounded and the scene goes on. An invalid line is reported by its number and counted. Lines from a socket
// cannot change urls or Scripts, like mirrors with the permission for events. Threading: a thread of its own reads; all
// calls on the scene's thread.

// Example:
//     #include <rtsg/feeds/feed.h>
//     rtsg::Scene scene;
//     rtsg::FeedOptions options;
//     options.source = "udp://127.0.0.1:0";
//     const auto feed = rtsg::Feed::start(scene, options);
//     if (!feed) return;  // feed.error() says why
//     for (int frame = 0; frame < 3; ++frame) {
//         (*feed)->deliver(frame / 60.0);
//         scene.newFrame(frame / 60.0);
//     }
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

struct FeedOptions {
    /// "-" (standard input), a file, udp://HOST:PORT, tcp://HOST:PORT (it listens there), mqtt://HOST[:PORT]/TOPIC.
    std::string source;
    /// Allows an address that other machines can reach.
    bool insecure = false;
    /// Events wait for their times, and deliver() waits for lines: for a scene in simulated time. If false, only events
    /// of a regular file wait for their times.
    bool timed = false;
    /// An eventfd that is written when lines have come. -1: none.
    int call = -1;
    /// Called while deliver() waits for lines; true ends the wait.
    std::function<bool()> cancelled = nullptr;
};

struct FeedCounts {
    std::uint64_t lines = 0;    // that were read
    std::uint64_t events = 0;   // that were sent to the scene
    std::uint64_t merged = 0;   // values that a newer one replaced before their frame
    std::uint64_t faulty = 0;   // invalid lines, or lines whose event was refused
    std::uint64_t flooded = 0;  // lines left out because too many waited
    bool broken = false;        // the source could not be read to its end
};

class Feed {
  public:
    /// The most lines that wait, and the bytes that they hold. A sender that can wait then waits.
    static constexpr std::size_t kMaxWaiting = 16384, kMaxBytes = std::size_t{16} << 20;
    /// The most events of inputOnly fields that wait for later frames.
    static constexpr std::size_t kMaxPutOff = 4096;

    /// Opens the source and begins to read. `scene` must outlive it. Errors: those of the source or the system; an
    /// address that other machines can reach, without `insecure`.
    static Result<std::unique_ptr<Feed>> start(Scene& scene, FeedOptions options);
    ~Feed();
    Feed(const Feed&) = delete;
    Feed& operator=(const Feed&) = delete;

    /// Call it before the frame at `t`, in seconds since the start: sends the events that have come, or those that are
    /// due if the source is timed.
    void deliver(double t);
    /// The time of the next event that waits; infinity if there is none.
    double nextAt() const;
    /// The source, with the port filled in.
    const std::string& source() const;
    FeedCounts counts() const;
    /// True if a line of a timed source has not been due yet.
    bool hasLeft() const;
    /// The faults since the last call, at most a hundred. Of equal faults the first eight are reported, then each one
    /// that doubles their number.
    std::vector<Diagnostic> takeDiagnostics();

  private:
    struct State;
    explicit Feed(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
