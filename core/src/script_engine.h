// ScriptEngine: the programs of one scene's Script nodes. Everything of SpiderMonkey is behind it.
//
// Invariant: a script's function never runs inside another call of the same engine deeper than kMaximumDepth; a script
// that failed to compile, ran out of time or memory is not called again until its url changes. Never throws.
// Threading: the scene's thread. Source: ISO/IEC 19775-1 V4.0, 29.2.
#pragma once

#include <memory>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/script.h>

namespace rtsg {

class ScriptEngine {
  public:
    ScriptEngine(Scene& scene, const ScriptOptions& options);
    ~ScriptEngine();
    ScriptEngine(const ScriptEngine&) = delete;
    ScriptEngine& operator=(const ScriptEngine&) = delete;

    /// Calls the function that handles events of `field`. `value`: block representation.
    void onEvent(Cascade& cascade, const Node& node, FieldIndex field, const void* value);
    /// initialize(), prepareEvents() or eventsProcessed(), as is due. As Behaviour::onTime.
    double onTime(Cascade& cascade, const Node& node);
    /// Drops the program of a node that is about to be destroyed; shutdown() is called, its outputs go nowhere.
    void forget(NodeId node);

    /// The behaviour of every Script type: finds the engine of the running scene, makes it on first use.
    static Behaviour behaviour();

  private:
    static ScriptEngine* of(Cascade& cascade);
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
