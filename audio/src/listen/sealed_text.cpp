// Texts that say what separates a source from the listener, and where a room loses sound.
#include "sealed_text.h"

#include <algorithm>
#include <optional>
#include <string>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "report/opening_text.h"
#include "scene/sound_fields.h"

namespace rtsg {
namespace {

std::string locationOf(const glm::dvec3& p) {
    return fmt::format("{:.4g} {:.4g} {:.4g}", p.x, p.y, p.z);
}

/// The place at which the node was read, if it was in that document.
std::optional<SourceLocation> lineOf(const Scene& scene, const std::filesystem::path& document, NodeId node) {
    if (document.empty() || document == "-") return std::nullopt;
    const NodeLocation location = scene.locationOf(node);
    if (location.where.line == 0 || location.file != document.string()) return std::nullopt;
    return location.where;
}

/// The name that an author gave a shape or its geometry, or the name of its material.
std::string shapeName(const Scene& scene, NodeId shape, NodeId geometry) {
    std::string text(scene.name(shape));
    if (text.empty()) text = scene.name(geometry);
    if (!text.empty()) return text;
    const Node* created = scene.find(geometry);
    const std::string name = created ? std::string(created->type().name) : "Shape";
    return (std::string_view("AEIO").find(name[0]) != std::string_view::npos ? "an " : "a ") + name;
}

std::optional<SourceLocation> lineOf(const Scene& scene, const std::filesystem::path& document, NodeId shape,
                                     NodeId geometry) {
    const auto line = lineOf(scene, document, shape);
    return line ? line : lineOf(scene, document, geometry);
}

/// Its name, and in brackets its material, size, place and line.
std::string shapeText(const Scene& scene, const std::filesystem::path& document, const WallShape& wall) {
    const auto& [shape, geometry, box, given] = wall;
    const Node* created = scene.find(geometry);
    const std::string name = shapeName(scene, shape, geometry),
                      what = created ? std::string(created->type().name) : "Shape";
    const bool named = !scene.name(shape).empty() || !scene.name(geometry).empty();
    const glm::dvec3 size = box.high - box.low;
    const auto line = lineOf(scene, document, shape, geometry);
    return fmt::format("{} ({}{:.4g} x {:.4g} x {:.4g} m about {}{})", name, named ? what + ", " : std::string(),
                       size.x, size.y, size.z, locationOf((box.low + box.high) / 2.0),
                       line ? fmt::format(", line {}", line->line) : std::string());
}

/// Whether a truth called "opening" is among the metadata.
bool saysOpening(const Scene& scene, NodeId metadata, int depth = 0) {
    constexpr int kDeepest = 16;
    const Node* node = scene.find(metadata);
    if (!node || depth > kDeepest) return false;
    if (node->is(x3d::MetadataSet::type))
        return std::ranges::any_of(node->get(x3d::MetadataSet::value),
                                   [&](NodeId child) { return saysOpening(scene, child, depth + 1); });
    if (!node->is(x3d::MetadataBoolean::type) || node->get(x3d::MetadataBoolean::name).view() != "opening")
        return false;
    const auto& values = node->get(x3d::MetadataBoolean::value);
    return !values.empty() && static_cast<bool>(values[0]);
}

/// Whether the author marked a shape beside the opening so that the opening is intended.
bool isMeant(const Scene& scene, const RoomOpenings& openings) {
    return std::ranges::any_of(openings.beside, [&](const WallShape& beside) {
        const Node* shape = scene.find(beside.shape);
        return shape && shape->is(x3d::Shape::type) && saysOpening(scene, shape->get(x3d::Shape::metadata));
    });
}

}  // namespace

void nameShapes(const Scene& scene, RoomOpenings& openings) {
    openings.leak = openings.leak && !isMeant(scene, openings);
    for (WallShape& beside : openings.beside) beside.name = shapeName(scene, beside.shape, beside.geometry);
}

void reportLeaks(const Scene& scene, std::span<const SoundLeak> leaks, const std::filesystem::path& document,
                 Diagnostics& diagnostics) {
    for (const SoundLeak& leak : leaks) {
        const RoomOpenings& openings = leak.openings;
        if (isMeant(scene, openings)) continue;
        Diagnostic reported{Severity::warning, {}, {}, {}, DiagnosticCode("leak")};
        std::vector<std::string> names;
        for (const WallShape& beside : openings.beside) {
            names.push_back(shapeText(scene, document, beside));
            if (const auto where = lineOf(scene, document, beside.shape, beside.geometry);
                where && reported.file.empty()) {
                reported.file = document.string();
                reported.where = *where;
            }
        }
        reported.text = lossText(openings, leak.name, listed(names));
        diagnostics.add(std::move(reported));
    }
}

void reportSealed(const Scene& scene, std::span<const SealedSource> sealed, double start,
                  const std::filesystem::path& document, Diagnostics& diagnostics) {
    for (const SealedSource& found : sealed) {
        const Seal& seal = found.seal;
        std::vector<std::string> texts;
        for (const WallShape& shape : seal.shapes) texts.push_back(shapeText(scene, document, shape));
        if (seal.more > 0) texts.push_back(fmt::format("{} more", seal.more));
        const std::string shapes = listed(texts);
        const std::string from = fmt::format("from {:.2f} s ", found.seconds - start);
        const std::string since = found.until ? (found.seconds > start ? from + "to" : "until") +
                                                    fmt::format(" {:.2f} s ", *found.until - start)
                                  : found.seconds > start ? from + "on "
                                                          : std::string();
        const std::string source = locationOf(found.source), listener = locationOf(found.listener);
        Diagnostic reported{Severity::warning, {}, {}, {}, DiagnosticCode("sealed")};
        reported.text = fmt::format("{}nothing is heard of {}: ", since, found.name);
        if (seal.proven)
            reported.text +=
                seal.sourceInside
                    ? fmt::format("it is at {}, closed in by {}, and the listener is outside, at {}", source, shapes,
                                  listener)
                    : fmt::format("the listener is at {}, closed in by {}, and the source is outside, at {}", listener,
                                  shapes, source);
        else
            reported.text +=
                seal.sourceInside
                    ? fmt::format("no way was found out from its place, {}, past {}, to the listener at {}", source,
                                  shapes, listener)
                    : fmt::format("no way was found in from its place, {}, past {}, to the listener at {}", source,
                                  shapes, listener);
        if (const auto where = lineOf(scene, document, found.sound)) {
            reported.file = document.string();
            reported.where = *where;
        }
        diagnostics.add(std::move(reported));
    }
}

}  // namespace rtsg
