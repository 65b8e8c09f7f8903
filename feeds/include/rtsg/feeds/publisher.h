// Publisher: writes the events of a scene's fields as lines of JSON: to a pipe, a file, sockets, or an MQTT broker.
//
// A line is {"t":1.5,"node":"DOOR","field":"rotation","value":[0,1,0,0.8]}, which a Feed can read. Without a rate every
// event is a line, in the order in which they happened; with a rate, the newest value of a field is written at most so
// many times a second. Invariant: no reader holds up the scene. If there is no room for a line, the whole line is left
// out, and counted. Threading: a thread of its own sends; all calls on the scene's thread.

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
    /// "-" (standard output), a file to append to, udp://HOST:PORT (a datagram for each line), tcp://HOST:PORT (it
    /// listens there for readers), mqtt://HOST[:PORT]/TOPIC.
    std::string target;
    /// "DEF.field", or "DEF.*" for all of its fields that send events.
    std::vector<std::string> fields;
    /// The most lines a second for each field; 0: one line for each event.
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
    std::uint64_t missed = 0;     // that the target, or one of its readers, did not get
    std::size_t subscribers = 0;  // connections now
};

class Publisher {
  public:
    /// Opens the target and begins to listen to the fields. `scene` must outlive it. Errors: no such node or field, or
    /// a field that sends nothing; those of the target or the system; an address that other machines can reach, without
    /// `insecure`.
    static Result<std::unique_ptr<Publisher>> start(Scene& scene, PublishOptions options);
    /// Ends as close() does.
    ~Publisher();
    Publisher(const Publisher&) = delete;
    Publisher& operator=(const Publisher&) = delete;

    /// Sets the time of the next frame for its lines, in seconds since the start. Without this call, lines have the
    /// scene's time minus the start, rounded to a microsecond, since times since 1970 are not exact beyond that as
    /// doubles.
    void expect(double t);
    /// Call it after the frame at `t`, in seconds since the start: sends values that waited because of the rate and are
    /// due now.
    void frame(double t);
    /// Sends all waiting lines, for half a second at most; the counts are then final. Nothing is sent later.
    void close();
    /// The time at which the next waiting value is due; infinity if there is none.
    double nextAt() const;
    /// The target, with the port filled in.
    const std::string& target() const;
    PublishCounts counts() const;
    /// The faults since the last call, each once.
    std::vector<Diagnostic> takeDiagnostics();

  private:
    struct State;
    explicit Publisher(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
