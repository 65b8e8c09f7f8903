// Listeners: functions that hear what one field sends, what happens to one node, and that another world is there.
//
// They are called when a frame, or a set of edits, is complete: the scene is in the state that it led to, and what they
// edit or send belongs to the next one. So they may do anything, end themselves included. Each costs what it listens
// to: a scene without listeners pays nothing, nor does a node that nobody listens to. On a replica, where events do not
// run, they hear of values that changed. Threading: the scene's thread.
// Source: ISO/IEC 19775-2 V4.0 (registerFieldInterest, registerBrowserInterest); RTSG paper 3.3 (listeners of nodes).

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
        changed,    // `field` has another value, once a set whatever happened in it
        entered,    // a way leads to it from the root, and did not before
        left,       // none does any more
        destroyed,  // it is gone; nothing is heard of it after this
    };
    Kind kind = Kind::changed;
    NodeId node;
    FieldIndex field = kNoField;  // of `changed`
    double time = 0;              // of the frame, in seconds
};

class Listeners {
  public:
    /// `scene` must outlive it. Several may listen to one scene, in the order in which they began.
    explicit Listeners(Scene& scene);
    ~Listeners();
    Listeners(const Listeners&) = delete;
    Listeners& operator=(const Listeners&) = delete;

    /// Hears every event of the field, in the order of the cascade, also where the value is the one before; and once a
    /// set, where it was edited instead, the value that it has come to. Errors: no such node, or a field that sends
    /// nothing (inputOnly, initializeOnly).
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
    /// Hears that another world has been loaded (world.h), and that a replica has joined anew: what was known of nodes
    /// before is void.
    ListenerId onWorld(std::function<void()> call);
    /// Also from within a call, whichever. One that has ended already is no error.
    void end(ListenerId listener);
    std::size_t count() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
