// Writes a robot as X3D: its links and joints, their shapes, and mimicking joints.
#include "import_urdf.h"

#include <algorithm>
#include <cctype>
#include <map>

#include "import/imported_names.h"
#include "output_node.h"
#include "sdf_model.h"
#include "urdf_joints.h"
#include "urdf_view.h"

namespace rtsg::detail {

namespace {

using Kind = UrdfJoint::Kind;

constexpr double kQuarter = 1.5707963267948966;
constexpr std::string_view kSwitch = "collisions";

class UrdfWriter {
  public:
    UrdfWriter(const UrdfModel& model, std::string_view from, const ImportInput& input, DocumentHandler& out)
        : model_(model), from_(from), input_(input), out_(out) {}

    void run() {
        nameAll();
        beginImported(out_, from_, "4.1");
        if (!model_.name.empty()) out_.meta("title", model_.name, {});
        for (const Kind kind : {Kind::revolute, Kind::continuous, Kind::prismatic})
            if (std::ranges::any_of(model_.joints, [&](const UrdfJoint& joint) { return joint.kind == kind; }))
                declareJoint(out_, kind);
        writeViewpoint(out_, model_);
        const bool hasCollisions =
            std::ranges::any_of(model_.links, [](const UrdfLink& link) { return !link.collisions.empty(); });
        {
            OutputNode robot(out_, "Transform", {}, robotName_);
            robot.set("rotation", Rotation{1, 0, 0, static_cast<float>(-kQuarter)});
            for (const std::uint32_t root : model_.roots) writeTree(root);
        }
        if (hasCollisions) {
            OutputNode(out_, "Group", {}, switchName_).set("visible", false);
            for (const auto& [node, field] : shown_) out_.route(switchName_, "visible", node, field, {});
        }
        for (const std::uint32_t number : model_.mimicOrder) writeMimicOf(number);
        // So that scenes which inline the robot may import its joints, and have routes to them.
        for (std::size_t i = 0; i < model_.joints.size(); ++i)
            if (model_.joints[i].kind != Kind::fixed) out_.exportNode(joints_[i], joints_[i], model_.joints[i].where);
        out_.endDocument();
    }

  private:
    // ---- names. Joints come first: theirs are those that feeds and scripts use.
    void nameAll() {
        for (const UrdfJoint& joint : model_.joints) joints_.push_back(names_.take(joint.name, "joint"));
        for (const UrdfLink& link : model_.links) links_.push_back(names_.take(link.name, "link"));
        robotName_ = names_.take(model_.name, "robot");
        switchName_ = names_.take(kSwitch);
    }

    // ---- the hierarchy, with a stack of its own
    void writeTree(std::uint32_t root) {
        struct Open {
            std::uint32_t link;
            std::size_t next = 0;
        };
        std::vector<Open> open;
        const auto begin = [&](std::uint32_t number) {
            const UrdfLink& link = model_.links[number];
            out_.beginNode("Transform", links_[number], "children", link.where);
            for (const UrdfShape& visual : link.visuals) writeShape(visual, false);
            if (!link.collisions.empty()) writeCollisions(link, links_[number]);
            open.push_back({number});
        };
        begin(root);
        while (!open.empty()) {
            Open& top = open.back();
            const UrdfLink& link = model_.links[top.link];
            if (top.next == link.joints.size()) {
                out_.endNode({});
                open.pop_back();
                if (!open.empty()) out_.endNode({});  // the joint
                continue;
            }
            const std::uint32_t number = link.joints[top.next++];
            beginJoint(out_, model_.joints[number], joints_[number]);
            begin(model_.joints[number].child);
        }
    }
    void writeMimicOf(std::uint32_t number) {
        const UrdfJoint& joint = model_.joints[number];
        const UrdfJoint& leader = model_.joints[joint.mimic->joint];
        const std::string name = names_.take(joints_[number] + "_mimic");
        writeMimic(out_, leader, *joint.mimic, name);
        out_.route(joints_[joint.mimic->joint], valueField(leader.kind), name, "set_fraction", {});
        out_.route(name, "value_changed", joints_[number], valueField(joint.kind), {});
    }
    /// All collisions of the robot are seen, and their meshes loaded, when the one Group says so.
    void writeCollisions(const UrdfLink& link, const std::string& name) {
        const std::string def = names_.take(name + "_collision");
        OutputNode group(out_, "Group", "children", def, link.where);
        group.set("visible", false);
        shown_.emplace_back(def, "visible");
        for (const UrdfShape& collision : link.collisions) writeShape(collision, true);
    }

    // ---- shapes
    void writeShape(const UrdfShape& shape, bool isCollision) {
        const std::string def = names_.take(shape.name, isCollision ? "collision" : "visual");
        const bool isPlaced = !def.empty() || !isIdentity(shape.origin);
        if (isPlaced) {
            out_.beginNode("Transform", def, "children", shape.where);
            writePose(out_, shape.origin);
        }
        if (shape.kind == UrdfShape::Kind::mesh)
            writeMesh(shape, isCollision);
        else
            writeBody(shape, isCollision);
        if (isPlaced) out_.endNode({});
    }
    void writeBody(const UrdfShape& shape, bool isCollision) {
        // A cylinder's axis is z here, and y in X3D.
        const bool isTurned = shape.kind == UrdfShape::Kind::cylinder;
        if (isTurned) {
            out_.beginNode("Transform", {}, "children", shape.where);
            out_.setField("rotation", Value(Rotation{1, 0, 0, static_cast<float>(kQuarter)}), {});
        }
        {
            OutputNode body(out_, "Shape", "children", {}, shape.where);
            writeAppearance(shape, isCollision);
            const auto size = [&](std::size_t i) { return static_cast<float>(shape.size[i]); };
            if (shape.kind == UrdfShape::Kind::box) {
                OutputNode(out_, "Box", "geometry").set("size", Vec3f(size(0), size(1), size(2)));
            } else if (shape.kind == UrdfShape::Kind::sphere) {
                OutputNode(out_, "Sphere", "geometry").set("radius", size(0));
            } else {
                OutputNode cylinder(out_, "Cylinder", "geometry");
                cylinder.set("height", size(1));
                cylinder.set("radius", size(0));
            }
        }
        if (isTurned) out_.endNode({});
    }
    void writeAppearance(const UrdfShape& shape, bool isCollision) {
        UrdfMaterial look = shape.material.value_or(UrdfMaterial());
        if (isCollision) look = {std::string(kSwitch), std::array<double, 4>{1, .5, 0, .4}, {}};
        if (const auto known = looks_.find(look); known != looks_.end())
            return out_.useNode(known->second, "appearance", shape.where);
        const std::string def = names_.take(isCollision         ? "collision"
                                            : look.name.empty() ? "material"
                                                                : look.name,
                                            "material");
        looks_.emplace(look, def);
        OutputNode appearance(out_, "Appearance", "appearance", def, shape.where);
        {
            OutputNode material(out_, "Material", "material");
            if (look.color) {
                const auto part = [&](std::size_t i) {
                    return static_cast<float>(std::clamp((*look.color)[i], 0.0, 1.0));
                };
                material.set("diffuseColor", Color{part(0), part(1), part(2)});
                if (part(3) < 1) material.set("transparency", 1 - part(3));
            }
        }
        if (!look.texture.empty())
            OutputNode(out_, "ImageTexture", "texture", {}, shape.where)
                .set("url", Array<String>{String(look.texture)});
    }

    // ---- meshes
    static bool endsWith(std::string_view url, std::string_view extension) {
        url = url.substr(0, url.find('#'));
        return url.size() >= extension.size() &&
               std::ranges::equal(url.substr(url.size() - extension.size()), extension,
                                  [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; });
    }
    /// The reader of Collada turns what points up in a file to y; a robot means the file's own axes, which this turns
    /// back to.
    Rotation ownAxes(const std::string& url) {
        if (!endsWith(url, ".dae") || !input_.open) return {};
        const auto [known, isNew] = axes_.try_emplace(url);
        if (!isNew) return known->second;
        const auto text = input_.open(url);
        if (!text) return {};  // whoever loads it names it
        constexpr std::string_view kTag = "<up_axis>";
        const std::size_t tag = text->find(kTag);
        if (tag == text->npos) return {};
        const std::string_view up = std::string_view(*text).substr(tag + kTag.size(), 4);
        const auto quarter = static_cast<float>(kQuarter);
        if (up == "Z_UP") known->second = {1, 0, 0, quarter};
        if (up == "X_UP") known->second = {0, 0, 1, -quarter};
        return known->second;
    }
    /// Whether the file has materials of its own, which the robot's do not replace.
    bool hasMaterials(const std::string& url) {
        if (endsWith(url, ".stl") || endsWith(url, ".ply")) return false;
        if (!endsWith(url, ".obj") || !input_.open) return true;
        const auto text = input_.open(url);
        if (!text) return true;
        const std::size_t second = text->find("\nusemtl");
        const std::size_t group = text->find("\ng "), object = text->find("\no ");
        const auto isAgain = [&](std::size_t at, std::string_view word) {
            return at != text->npos && text->find(word, at + 1) != text->npos;
        };
        // A file with several groups or objects gives several shapes, and a geometry can have only one.
        return second != text->npos || isAgain(group, "\ng ") || isAgain(object, "\no ");
    }
    void writeMesh(const UrdfShape& shape, bool isCollision) {
        const bool isScaled = shape.size != std::array<double, 3>{1, 1, 1};
        const Rotation axes = ownAxes(shape.mesh);
        const bool isTurned = axes.angle != 0;
        if (isScaled) {
            out_.beginNode("Transform", {}, "children", shape.where);
            out_.setField("scale",
                          Value(Vec3f(static_cast<float>(shape.size[0]), static_cast<float>(shape.size[1]),
                                      static_cast<float>(shape.size[2]))),
                          {});
        }
        if (isTurned) {
            out_.beginNode("Transform", {}, "children", shape.where);
            out_.setField("rotation", Value(axes), {});
        }
        const auto isPlain = plain_.try_emplace(shape.mesh, false);
        if (isPlain.second) isPlain.first->second = !hasMaterials(shape.mesh);
        if (isPlain.first->second) {
            OutputNode body(out_, "Shape", "children", {}, shape.where);
            writeAppearance(shape, isCollision);
            writeFile("InlineGeometry", "geometry", shape, isCollision);
        } else {
            writeFile("Inline", "children", shape, isCollision);
        }
        for (const bool isOpen : {isTurned, isScaled})
            if (isOpen) out_.endNode({});
    }
    void writeFile(std::string_view type, std::string_view field, const UrdfShape& shape, bool isCollision) {
        std::string def;
        if (isCollision) shown_.emplace_back(def = names_.take("mesh", "collision"), "load");
        OutputNode file(out_, type, field, def, shape.where);
        if (isCollision) file.set("load", false);
        if (type == "InlineGeometry") file.set("smooth", !endsWith(shape.mesh, ".stl"));
        file.set("url", Array<String>{String(shape.mesh)});
    }

    const UrdfModel& model_;
    const std::string_view from_;
    const ImportInput& input_;
    DocumentHandler& out_;
    UniqueNames names_;
    std::vector<std::string> joints_, links_;  // their DEFs
    std::string robotName_, switchName_;
    std::vector<std::pair<std::string, std::string>> shown_;  // fields that are true where collisions are seen
    std::map<UrdfMaterial, std::string> looks_;               // their DEFs
    std::map<std::string, Rotation> axes_;                    // of Collada files, by their urls
    std::map<std::string, bool> plain_;                       // files without materials, by their urls
};

}  // namespace

bool importUrdf(const ImportInput& input, DocumentHandler& handler, Diagnostics& diagnostics) {
    UrdfModel model;
    if (!readUrdf(input.bytes, model, diagnostics)) return false;
    UrdfWriter(model, "from URDF", input, handler).run();
    return true;
}

bool importSdf(const ImportInput& input, DocumentHandler& handler, Diagnostics& diagnostics) {
    UrdfModel model;
    if (!readSdf(input.bytes, model, diagnostics)) return false;
    UrdfWriter(model, "from SDF", input, handler).run();
    return true;
}

}  // namespace rtsg::detail
