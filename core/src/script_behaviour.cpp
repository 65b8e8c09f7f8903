// Where the cascade meets the engine.
#include "scene_state.h"
#include "script_engine.h"

namespace rtsg {

ScriptEngine* ScriptEngine::of(Cascade& cascade) {
    Scene::State& s = *cascade.scene_.state_;
    if (!s.scriptOptions.enabled) return nullptr;
    if (!s.scripts) s.scripts = std::make_unique<ScriptEngine>(cascade.scene_, s.scriptOptions);
    return s.scripts.get();
}

Behaviour ScriptEngine::behaviour() {
    return {
        .onEvent =
            [](Cascade& cascade, const Node& node, FieldIndex field, const void* value) {
                if (ScriptEngine* engine = of(cascade)) engine->onEvent(cascade, node, field, value);
            },
        .onTime =
            [](Cascade& cascade, const Node& node) {
                ScriptEngine* engine = of(cascade);
                return engine ? engine->onTime(cascade, node) : kNever;
            },
    };
}

void Scene::setScriptOptions(ScriptOptions options) {
    state_->scriptOptions = std::move(options);
    state_->scripts.reset();
}

void Scene::setScriptBase(const std::filesystem::path& base) {
    if (state_->scriptOptions.base.empty() && !state_->scripts) state_->scriptOptions.base = base;
}

}  // namespace rtsg
