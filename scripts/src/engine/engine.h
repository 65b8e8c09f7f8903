// ScriptEngine: ScriptPrograms in ECMAScript. Everything of SpiderMonkey is behind it.
//
// Invariant: a script's function never runs inside another call of the same engine deeper than kMaximumDepth; a script
// that failed to compile, ran out of time or memory is not called again until its url changes. Never throws.
// Threading: the scene's thread. Source: ISO/IEC 19775-1 V4.0, 29.2.
#pragma once

#include <rtsg/core/script_language.h>

namespace rtsg {

class ScriptEngine final : public ScriptPrograms {
  public:
    ScriptEngine(Scene& scene, const ScriptOptions& options);
    ~ScriptEngine() override;
    ScriptEngine(const ScriptEngine&) = delete;
    ScriptEngine& operator=(const ScriptEngine&) = delete;

    void onEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) override;
    double onTime(Cascade& cascade, const Node& node, ScriptPhase phase) override;
    void findHeld(const std::vector<NodeId>& nodes,
                  const std::function<void(NodeId script, NodeId held)>& visit) override;
    void forget(NodeId node) override;
    void forgetAll() override;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
