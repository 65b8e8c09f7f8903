// Writes a humanoid: its points, its skeleton joint below joint, and its skin.
#include "gltf_figure.h"

namespace rtsg::detail {

using nlohmann::json;

namespace {

void writeJoints(GltfFile& file, DocumentHandler& out, const GltfFigure& figure,
                 const std::vector<GltfSkin::Influence>& influences, std::size_t root) {
    struct Open {
        std::size_t joint, next;
    };
    std::vector<Open> open;
    const auto begin = [&](std::size_t i) {
        const GltfSkin::Joint& joint = figure.skin.joints()[i];
        const json* node = file.item("nodes", joint.node);
        const GltfTransform transform = node ? transformOf(*node) : GltfTransform{};
        const std::string name = node ? GltfFile::text(*node, "name") : std::string();
        out.beginNode("HAnimJoint", figure.joints[i], open.empty() ? "skeleton" : "children", {});
        const auto set = [&](const char* field, auto value) { out.setField(field, Value(std::move(value)), {}); };
        set("name", String(name.empty() ? figure.joints[i] : name));
        set("center", joint.center);
        set("rotation", joint.rotation(transform.rotation));
        set("translation", joint.translation(transform.translation));
        if (const Vec3f scale = joint.scale(transform.scale); scale != Vec3f(1)) {
            set("scale", scale);
            set("scaleOrientation", joint.scaleOrientation);
        }
        if (!influences[i].points.empty()) {
            set("skinCoordIndex", influences[i].points);
            set("skinCoordWeight", influences[i].weights);
        }
        open.push_back({i, 0});
    };
    begin(root);
    while (!open.empty()) {
        const std::vector<std::size_t>& below = figure.skin.joints()[open.back().joint].below;
        if (open.back().next < below.size()) {
            begin(below[open.back().next++]);
        } else {
            out.endNode({});
            open.pop_back();
        }
    }
}

}  // namespace

void writeFigure(GltfFile& file, DocumentHandler& out, GltfMeshes& meshes, const GltfFigure& figure,
                 const json& primitive, const GltfForm& form) {
    const json& attributes = GltfFile::object(primitive, "attributes");
    Array<Vec3f> points = meshes.vectors(attributes, "POSITION", 0);
    if (points.empty()) return meshes.reportWithoutPoints(attributes);
    const auto influences = figure.skin.influences(file, attributes, points.size());
    meshes.morph(primitive, "POSITION", form.weights, points);
    GltfNode humanoid(out, "HAnimHumanoid", "children", figure.name);
    humanoid.set("name", String(figure.name));
    {
        GltfNode coordinate(out, "Coordinate", "skinCoord", form.points);
        coordinate.set("point", std::move(points));
    }
    const auto& joints = figure.skin.joints();
    for (std::size_t i = 0; i < joints.size(); ++i)
        if (joints[i].above == GltfSkin::kNone) writeJoints(file, out, figure, influences, i);
    for (std::size_t i = 0; i < joints.size(); ++i) out.useNode(figure.joints[i], "joints", {});
    meshes.writePrimitive(primitive, form, true);
}

}  // namespace rtsg::detail
