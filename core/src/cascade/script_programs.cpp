// Connects the cascade with the programs of Script nodes.
#include <rtsg/core/x3d.h>

#include "state/state.h"

namespace rtsg {

ScriptPrograms* ScriptPrograms::of(Cascade& cascade, const Node& node) {
    Scene::State& s = *cascade.scene_.state_;
    if (!s.scriptOptions.enabled) return nullptr;
    if (!s.scripts && s.scriptLanguage) s.scripts = s.scriptLanguage->makePrograms(cascade.scene_, s.scriptOptions);
    if (!s.scripts && !node.get(x3d::Script::url).empty())
        cascade.warn(node, "does not run: its scene has no script language (runScripts; none with RTSG_SCRIPTS=OFF)");
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
                if (ScriptPrograms* programs = of(cascade, node)) programs->onEvent(cascade, node, field, value);
            },
        .onTime =
            [](Cascade& cascade, const Node& node) {
                ScriptPrograms* programs = of(cascade, node);
                return programs ? programs->onTime(cascade, node, phase(cascade)) : kNever;
            },
    };
}

void Scene::setScripts(std::shared_ptr<const ScriptLanguage> language) {
    if (state_->refuseForeign()) return;
    if (state_->scripts) state_->scripts->forgetAll();
    state_->scripts.reset();
    state_->scriptLanguage = std::move(language);
}

void Scene::setDocuments(std::shared_ptr<const DocumentServices> documents) {
    if (!state_->refuseForeign() && documents) state_->documents = std::move(documents);
}

const DocumentServices& Scene::documents() const {
    return *state_->documents;
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
