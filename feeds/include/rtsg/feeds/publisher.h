// Publisher: what fields of a scene send goes out as lines of JSON: to a pipe, a file, sockets, or an MQTT broker.
//
// A line is {"t":1.5,"node":"DOOR","field":"rotation","value":[0,1,0,0.8]}, which a Feed takes. Without a rate every
// event is a line, clicks included, in the order in which they happened; with one, a field has its newest value so many
// times a second at most.
// Invariant: no reader holds up the scene. Lines that one has no room for are left out whole, and counted.
// Threading: a thread of its own sends; all calls on the scene's thread.

// Example:
//     #include <rtsg/core/x3d.h>
//     #include <rtsg/feeds/publisher.h>
//     rtsg::Scene scene;
//     const rtsg::NodeId box = scene.createNode(rtsg::x3d::Transform::type);
//     (void)scene.setName(box, "BOX");
//     rtsg::PublishOptions options;
//     options.target = "tcp://127.0.0.1:0";
//     options.fields = {"BOX.translation"};
//     const auto publisher = rtsg::Publisher::start(scene, options);
//     if (!publisher) return;  // publisher.error() says why
//     (void)scene.sendEvent(box, rtsg::x3d::Transform::translation.index, rtsg::Vec3f(2, 0, 0));
//     scene.newFrame(0);
//     (*publisher)->frame(0);
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/core/scene.h>

namespace rtsg {

struct PublishOptions {
    /// "-" (standard output), a file to add to, udp://HOST:PORT (a datagram for each line), tcp://HOST:PORT (whoever
    /// connects there), mqtt://HOST[:PORT]/TOPIC.
    std::string target;
    /// "DEF.field", or "DEF.*" for all of its fields that send events.
    std::vector<std::string> fields;
    /// Lines of each field a second at most; 0: one for each event.
    double rate = 0;
    /// The time on the scene's clock from which `t` counts.
    double start = 0;
    /// Allows an address that other machines can reach.
    bool insecure = false;
    /// Frames wait while 2 MiB of lines wait, for scenes in simulated time, which may be faster than a disk.
    bool waits = false;
};

struct PublishCounts {
    std::uint64_t events = 0;     // that were heard
    std::uint64_t lines = 0;      // that were handed to the target
    std::uint64_t missed = 0;     // that the target, or one of those connected, did not get
    std::size_t subscribers = 0;  // connections now
};

class Publisher {
  public:
    /// Opens the target and begins to listen. `scene` must outlive it. Errors: no such node or field, or one that sends
    /// nothing; what the target or the system says; an address that others reach, without `insecure`.
    static Result<std::unique_ptr<Publisher>> start(Scene& scene, PublishOptions options);
    /// Ends as close() does.
    ~Publisher();
    Publisher(const Publisher&) = delete;
    Publisher& operator=(const Publisher&) = delete;

    /// The coming frame's time since the start, in seconds, which its lines have. Without this call they have the
    /// scene's time less the start, rounded to a microsecond, since doubles of times since 1970 are exact to a quarter
    /// of that.
    void expect(double t);
    /// Call it after the frame at `t`, in seconds since the start: sends what waited for its turn.
    void frame(double t);
    /// Sends what waits, for its turn too, for half a second at most; the counts are final then. Nothing is sent after
    /// it.
    void close();
    /// When the next value that waits is due; infinity if there is none.
    double nextAt() const;
    /// The target, with the port filled in.
    const std::string& target() const;
    PublishCounts counts() const;
    /// What went wrong since the last call: each thing once.
    std::vector<Diagnostic> takeDiagnostics();

  private:
    struct State;
    explicit Publisher(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
