// Lets the Script nodes of a scene run: registers the language that they are written in, ECMAScript.
//
// Without it Scripts rest, and each says so. How they run, and within which limits: script.h. In builds without scripts
// (RTSG_SCRIPTS=OFF) there is no language. Threading: the scene's thread. Source: ISO/IEC 19777-1 V3.3.
#pragma once

#include <memory>

#include <rtsg/core/scene.h>
#include <rtsg/core/script_language.h>

namespace rtsg {

/// ECMAScript and the scene access of 19777-1; null in builds without scripts.
std::shared_ptr<const ScriptLanguage> ecmaScript();

/// Before the first frame.
inline void runScripts(Scene& scene) {
    scene.setScripts(ecmaScript());
}
inline void runScripts(Scene& scene, ScriptOptions options) {
    scene.setScripts(ecmaScript());
    scene.setScriptOptions(std::move(options));
}

}  // namespace rtsg
