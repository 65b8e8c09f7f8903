// Puts into words what keeps a source and the listener apart.
#include "sealed_text.h"

#include <string>

#include <fmt/format.h>

#include "scene/sound_fields.h"

namespace rtsg {
namespace {

std::string placeOf(const glm::dvec3& p) {
    return fmt::format("{:.4g} {:.4g} {:.4g}", p.x, p.y, p.z);
}

/// The name that an author gave it, or what it is made of; and where it is.
std::string shapeText(const Scene& scene, const Seal::Shape& shape) {
    const Node* geometry = scene.find(shape.geometry);
    std::string text(scene.name(shape.shape));
    if (text.empty()) text = scene.name(shape.geometry);
    const std::string what = geometry ? std::string(geometry->type().name) : "Shape";
    text = text.empty() ? "a " + what + " (" : text + " (" + what + ", ";
    const glm::dvec3 size = shape.box.high - shape.box.low;
    return fmt::format("{}{:.4g} x {:.4g} x {:.4g} m about {})", text, size.x, size.y, size.z,
                       placeOf((shape.box.low + shape.box.high) / 2.0));
}

}  // namespace

void tellSealed(const Scene& scene, std::span<const SealedSource> sealed, double start, Diagnostics& diagnostics) {
    for (const SealedSource& found : sealed) {
        const Seal& seal = found.seal;
        std::string shapes;
        for (const Seal::Shape& shape : seal.shapes) {
            const bool last = &shape == &seal.shapes.back() && seal.more == 0;
            shapes += (shapes.empty() ? "" : last ? " and " : ", ") + shapeText(scene, shape);
        }
        if (seal.more > 0) shapes += fmt::format(" and {} more", seal.more);
        const std::string source = fmt::format("{} at {}", found.name, placeOf(found.source));
        const std::string listener = "the listener at " + placeOf(found.listener);
        const std::string &inner = seal.sourceInside ? source : listener,
                          &outer = seal.sourceInside ? listener : source;
        const std::string since =
            found.seconds > start ? fmt::format(" from {:.2f} s on", found.seconds - start) : std::string();
        diagnostics.warning({},
                            seal.proven
                                ? fmt::format("{} is silent{}: {} is sealed in {}, and {} is outside", found.name,
                                              since, inner, shapes, outer)
                                : fmt::format("{} is silent{}: no way was found from {}, which is shut in by {}, to {}",
                                              found.name, since, inner, shapes, outer),
                            DiagnosticCode("sealed"));
    }
}

}  // namespace rtsg
