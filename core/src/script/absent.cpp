// In place of the engine in builds without scripts (RTSG_SCRIPTS=OFF): says so at each Script that would run.
#include <unordered_set>

#include <rtsg/core/x3d.h>

#include "scene/script_programs.h"
#include "syntax.h"

namespace rtsg {

namespace {

class AbsentPrograms final : public ScriptPrograms {
  public:
    void onEvent(Cascade& cascade, const Node& node, FieldIndex, const void*) override { say(cascade, node); }
    double onTime(Cascade& cascade, const Node& node, ScriptPhase) override {
        say(cascade, node);
        return kNever;
    }
    void findHeld(const std::vector<NodeId>&, const std::function<void(NodeId, NodeId)>&) override {}
    void forget(NodeId node) override { said_.erase(node.value); }
    void forgetAll() override { said_.clear(); }

  private:
    void say(Cascade& cascade, const Node& node) {
        if (!node.get(x3d::Script::url).empty() && said_.insert(node.id().value).second)
            cascade.warn(node, "does not run: scripts are left out of this build (RTSG_SCRIPTS=OFF)");
    }

    std::unordered_set<std::uint32_t> said_;
};

}  // namespace

std::unique_ptr<ScriptPrograms> makeScriptPrograms(Scene&, const ScriptOptions&) {
    return std::make_unique<AbsentPrograms>();
}

std::optional<script::SyntaxFault> script::syntaxFault(const std::string&) {
    return {};
}

}  // namespace rtsg
