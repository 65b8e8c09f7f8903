// Puts into words what keeps a source and the listener apart.
#include "sealed_text.h"

#include <optional>
#include <string>
#include <unordered_map>

#include <fmt/format.h>

#include <rtsg/core/loader.h>

#include "scene/sound_fields.h"

namespace rtsg {
namespace {

std::string placeOf(const glm::dvec3& p) {
    return fmt::format("{:.4g} {:.4g} {:.4g}", p.x, p.y, p.z);
}

/// Where a document has its nodes: by type and DEF name, and those without one by type if they are the only ones.
class NodePlaces final : public NullHandler {
  public:
    explicit NodePlaces(const std::filesystem::path& document) {
        Diagnostics known;  // told when the scene was read
        static_cast<void>(readDocumentFile(document, *this, known));
    }
    std::optional<SourceLocation> find(std::string_view type, std::string_view def) const {
        const auto found = places_.find(key(type, def));
        if (found == places_.end() || found->second.line == 0) return std::nullopt;
        return found->second;
    }

    void beginNode(std::string_view type, std::string_view def, std::string_view, SourceLocation where) override {
        const auto [known, fresh] = places_.try_emplace(key(type, def), where);
        if (!fresh && def.empty()) known->second = {};
    }

  private:
    static std::string key(std::string_view type, std::string_view def) {
        return std::string(type).append(" ").append(def);
    }
    std::unordered_map<std::string, SourceLocation> places_;
};

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

void tellSealed(const Scene& scene, std::span<const SealedSource> sealed, double start,
                const std::filesystem::path& document, Diagnostics& diagnostics) {
    std::optional<NodePlaces> places;
    if (!sealed.empty() && !document.empty() && document != "-") places.emplace(document);
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
        Diagnostic told{Severity::warning, {}, {}, {}, DiagnosticCode("sealed")};
        told.text = seal.proven ? fmt::format("{} is silent{}: {} is sealed in {}, and {} is outside", found.name,
                                              since, inner, shapes, outer)
                                : fmt::format("{} is silent{}: no way was found from {}, which is shut in by {}, to {}",
                                              found.name, since, inner, shapes, outer);
        const Node* node = places ? scene.find(found.sound) : nullptr;
        if (const auto where = node ? places->find(node->type().name, scene.name(found.sound)) : std::nullopt) {
            told.file = document.string();
            told.where = *where;
        }
        diagnostics.add(std::move(told));
    }
}

}  // namespace rtsg
