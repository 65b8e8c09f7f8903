// Formats the names of nodes.
#include <rtsg/session/labels.h>

#include <fmt/format.h>

namespace rtsg {

std::string labelOf(const Scene& scene, NodeId id) {
    const std::string_view name = scene.name(id);
    return name.empty() ? fmt::format("#{}", id.value) : std::string(name);
}

}  // namespace rtsg
