// Names of nodes, and text as JSON.
#include "labels.h"

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/terminal.h>

namespace rtsg::app {

std::string jsonString(std::string_view text) {
    return printFieldText(Value(String(asUtf8(text))), TextSyntax::json);
}

std::string nodeLabel(const Scene& scene, NodeId id) {
    const std::string_view name = scene.name(id);
    return name.empty() ? fmt::format("#{}", id.value) : std::string(name);
}

}  // namespace rtsg::app
