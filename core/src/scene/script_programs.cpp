// Where the cascade meets the programs of Script nodes.
#include "state.h"

namespace rtsg {

ScriptPrograms* ScriptPrograms::of(Cascade& cascade) {
    Scene::State& s = *cascade.scene_.state_;
    if (!s.scriptOptions.enabled) return nullptr;
    if (!s.scripts) s.scripts = makeScriptPrograms(cascade.scene_, s.scriptOptions);
    return s.scripts.get();
}

ScriptPhase ScriptPrograms::phase(Cascade& cascade) {
    return cascade.scene_.state_->scriptPhase;
}

void ScriptPrograms::warn(Scene& scene, const Node& node, const std::string& text) {
    scene.state_->warn(node, text);
}

Behaviour ScriptPrograms::behaviour() {
    return {
        .onEvent =
            [](Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
                if (ScriptPrograms* programs = of(cascade)) programs->onEvent(cascade, node, field, value);
            },
        .onTime =
            [](Cascade& cascade, const Node& node) {
                ScriptPrograms* programs = of(cascade);
                return programs ? programs->onTime(cascade, node, phase(cascade)) : kNever;
            },
    };
}

void Scene::setScriptOptions(ScriptOptions options) {
    if (state_->refuseForeign()) return;
    if (state_->scripts) state_->scripts->forgetAll();
    state_->scriptOptions = std::move(options);
    state_->resourcesGiven = state_->scriptOptions.resources != nullptr;
    state_->scripts.reset();
}

void Scene::setScriptResources(std::shared_ptr<const Resources> resources, bool anotherWorld) {
    State& s = *state_;
    if (s.refuseForeign() || s.resourcesGiven) return;
    if (anotherWorld && s.scripts) {
        s.scripts->forgetAll();
        s.scripts.reset();
    }
    if (anotherWorld || (!s.scriptOptions.resources && !s.scripts)) s.scriptOptions.resources = std::move(resources);
}

}  // namespace rtsg
