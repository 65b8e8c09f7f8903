// Feed: events for a scene from outside, as lines of JSON or CSV: from a pipe, a file, sockets, or an MQTT broker.
//
// A line is {"node":"DOOR","field":"translation","value":[1,0,0]}, perhaps with "t" and "author", as `rtsg run --watch`
// prints it; or CSV. Events go into the next frame. Of a field that has a value, each frame takes the newest one; a
// field that only takes events gets one a frame, and the others wait for the frames after.
// Invariant: whatever comes, memory is bounded and the scene goes on. A line that makes no sense is named by its number
// and counted. What comes by a socket changes neither urls nor Scripts, as mirrors with the permission for events.
// Threading: a thread of its own reads; all calls on the scene's thread.

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
    /// Events wait for their times, and deliver() waits for lines: for a scene in simulated time. Otherwise only those
    /// of a regular file do.
    bool timed = false;
    /// An eventfd that is written when something has come. -1: none.
    int call = -1;
    /// Asked while deliver() waits for lines.
    std::function<bool()> cancelled = nullptr;
};

struct FeedCounts {
    std::uint64_t lines = 0;    // that were read
    std::uint64_t events = 0;   // that were sent to the scene
    std::uint64_t merged = 0;   // values that a newer one replaced before their frame
    std::uint64_t faulty = 0;   // lines that made no sense, or whose event was refused
    std::uint64_t flooded = 0;  // lines left out since too many waited
    bool broken = false;        // the source could not be read to its end
};

class Feed {
  public:
    /// The most lines that wait, and the bytes that they hold. A sender that can wait then waits.
    static constexpr std::size_t kMostWaiting = 16384, kMostBytes = std::size_t{16} << 20;
    /// The most events of fields that only take events, which wait for later frames.
    static constexpr std::size_t kMostPutOff = 4096;

    /// Opens the source and begins to read. `scene` must outlive it. Errors: what the source or the system says; an
    /// address that others reach, without `insecure`.
    static Result<std::unique_ptr<Feed>> start(Scene& scene, FeedOptions options);
    ~Feed();
    Feed(const Feed&) = delete;
    Feed& operator=(const Feed&) = delete;

    /// Call it before the frame at `t`, in seconds since the start: sends what has come, of a timed source what is due.
    void deliver(double t);
    /// When the next event that waits for its time is due, or one was put off; infinity if there is none.
    double nextAt() const;
    /// The source, with the port filled in.
    const std::string& source() const;
    FeedCounts counts() const;
    /// True if a line of a timed source has not been due yet.
    bool hasLeft() const;
    /// What was wrong since the last call, at most a hundred: of many equal faults the first eight, then each that
    /// doubles their number.
    std::vector<Diagnostic> takeDiagnostics();

  private:
    struct State;
    explicit Feed(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
