// Listeners: functions that are called when a field sends, when a node changes, and when another world is loaded.
//
// They are called when a frame, or a set of edits, is complete: the scene is in the state after it, and whatever they
// edit or send belongs to the next one. So they may do anything, also end themselves. Only nodes that have listeners
// cost time. On a replica, where events do not run, listeners hear of values that changed. Threading: the scene's
// thread. Source: ISO/IEC 19775-2 V4.0 (registerFieldInterest, registerBrowserInterest); RTSG paper 3.3 (listeners of
// nodes).

// Example:
//     #include <rtsg/core/listeners.h>
//     #include <rtsg/core/x3d.h>
//     rtsg::Scene scene;
//     const rtsg::NodeId box = scene.createNode(rtsg::x3d::Transform::type);
//     rtsg::Listeners listeners(scene);
//     const auto moved = listeners.onField(box, rtsg::x3d::Transform::translation,
//                                          [](const rtsg::Vec3f& to, double) { std::cout << to.x << '\n'; });
//     if (moved) (void)scene.sendEvent(box, rtsg::x3d::Transform::translation.index, rtsg::Vec3f(2, 0, 0));
//     scene.newFrame(0);  // prints 2
#pragma once

#include <functional>
#include <memory>

#include <rtsg/core/scene.h>

namespace rtsg {

enum class ListenerId : std::uint32_t {};

struct NodeEvent {
    enum class Kind : std::uint8_t {
        changed,    // `field` has another value; once in a set at most
        entered,    // a path leads to it from the root, and none did before
        left,       // no path leads to it any more
        destroyed,  // it is gone; nothing is heard of it later
    };
    Kind kind = Kind::changed;
    NodeId node;
    FieldIndex field = kNoField;  // for `changed`
    double time = 0;              // of the frame, in seconds
};

class Listeners {
  public:
    /// `scene` must outlive it. Several Listeners may listen to one scene; they are called in the order of their
    /// construction.
    explicit Listeners(Scene& scene);
    ~Listeners();
    Listeners(const Listeners&) = delete;
    Listeners& operator=(const Listeners&) = delete;

    /// Hears every event of the field, in the order of the cascade, also if the value did not change. If the field was
    /// edited instead, it hears the final value once in a set. Errors: no such node, or a field that sends nothing
    /// (inputOnly, initializeOnly).
    using OnField = std::function<void(const FieldEvent& event, double time)>;
    Result<ListenerId> onField(NodeId node, FieldIndex field, OnField call);
    template <class T, class Call>
    Result<ListenerId> onField(NodeId node, Field<T> field, Call call) {
        return onField(node, field.index, [call = std::move(call)](const FieldEvent& event, double time) {
            call(event.value.as<T>(), time);
        });
    }
    /// Errors: no such node.
    using OnNode = std::function<void(const NodeEvent& event)>;
    Result<ListenerId> onNode(NodeId node, OnNode call);
    /// Hears that another world has been loaded (world.h), or that a replica has joined anew: earlier knowledge of
    /// nodes is then void.
    ListenerId onWorld(std::function<void()> call);
    /// Ends a listener, also during any call. Ending one twice is no error.
    void end(ListenerId listener);
    std::size_t count() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
