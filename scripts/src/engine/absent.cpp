// Replaces the engine in builds without scripts (RTSG_SCRIPTS=OFF): there is no language.
#include <rtsg/scripts/run_scripts.h>

namespace rtsg {

std::shared_ptr<const ScriptLanguage> ecmaScript() {
    return nullptr;
}

}  // namespace rtsg
