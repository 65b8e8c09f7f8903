// Makes the Script nodes of a scene run: registers their language, ECMAScript.
//
// Without it Scripts do not run, and a warning for each says so. script.h describes how they run, and their limits. In
// builds without scripts (RTSG_SCRIPTS=OFF) there is no language. Threading: the scene's thread. Source: ISO/IEC
// 19777-1 V3.3.
#pragma once

#include <memory>

#include <rtsg/core/scene.h>
#include <rtsg/core/script_language.h>

namespace rtsg {

/// ECMAScript and the scene access of 19777-1; null in builds without scripts.
std::shared_ptr<const ScriptLanguage> ecmaScript();

/// Call it before the first frame.
inline void runScripts(Scene& scene) {
    scene.setScripts(ecmaScript());
}
inline void runScripts(Scene& scene, ScriptOptions options) {
    scene.setScripts(ecmaScript());
    scene.setScriptOptions(std::move(options));
}

}  // namespace rtsg
