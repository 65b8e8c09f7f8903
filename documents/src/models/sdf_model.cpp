// Reads an SDF file: its frames first, and then links, joints and shapes in them.
#include "sdf_model.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <span>

#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/portable_math.h>
#include <rtsg/core/rotation.h>

#include "robot_reader.h"

namespace rtsg::detail {

namespace {

constexpr double kRadians = 3.141592653589793 / 180;
constexpr double kMaxAngle = 64 * 6.283185307179586;  // of a joint with limits
constexpr double kFarthest = 1000;                    // m: how far a joint slides that has no limits
constexpr std::size_t kDeepestFrame = 200;

/// A frame within another.
struct SdfFrame {
    glm::dvec3 position{0};
    glm::dquat rotation{1, 0, 0, 0};

    SdfFrame operator*(const SdfFrame& inner) const {
        return {position + rotation * inner.position, rotation * inner.rotation};
    }
    SdfFrame inverse() const {
        const glm::dquat back = glm::conjugate(rotation);
        return {back * -position, back};
    }
    /// First turned about the fixed axes x, y and z, then moved.
    UrdfPose pose() const {
        const glm::dmat3 m = glm::mat3_cast(rotation);  // m[column][row]
        const double pitch = portable::atan2(-m[0][2], std::sqrt(m[0][0] * m[0][0] + m[0][1] * m[0][1]));
        const bool isUpright = std::abs(m[0][2]) < 1 - 1e-12;
        return {{position.x, position.y, position.z},
                {isUpright ? portable::atan2(m[1][2], m[2][2]) : 0, pitch,
                 isUpright ? portable::atan2(m[0][1], m[0][0]) : portable::atan2(-m[1][0], m[1][1])}};
    }
};

/// From the z axis.
glm::dquat rotationTo(const glm::dvec3& up) {
    const glm::dvec3 axis(-up.y, up.x, 0);
    if (glm::length(axis) < 1e-12) return up.z > 0 ? glm::dquat(1, 0, 0, 0) : glm::dquat(0, 1, 0, 0);
    return rotationAround(glm::normalize(axis), portable::atan2(glm::length(axis), up.z));
}

class SdfReader : private RobotReader {
  public:
    using RobotReader::RobotReader;

    bool run(std::string_view text) {
        if (!tree_.read(text, diagnostics_)) return false;
        const XmlElement& root = tree_.root();
        const XmlElement* world = tree_.child(root, "world");
        const XmlElement& around = world ? *world : root;
        const XmlElement* only = tree_.child(around, "model");
        if (!only) {
            error(root, "there is no model in the file");
            return false;
        }
        model_.name = nameOf(world ? *world : *only);
        model_.links.push_back({model_.name.empty() ? "base" : model_.name + "_base", {}, {}, {}, around.where});
        model_.roots.push_back(0);
        tree_.forEach(around, "model", [&](const XmlElement& e) { addModel(e, SdfFrame(), world ? nameOf(e) : ""); });
        countOthers(around, {"model", "world"});
        reportOthers();
        return true;
    }

  private:
    static std::string named(const XmlElement& e) { return e.name + " " + nameOf(e) + ": "; }

    // ---- numbers
    bool numbersOf(const XmlElement& e, std::span<double> numbers) {
        std::string_view text = e.text;
        if (std::ranges::all_of(numbers, [&](double& number) { return takeNumber(text, number); })) return true;
        error(e, e.name + " \"" + e.text.substr(0, 60) + "\": expected " + std::to_string(numbers.size()) + " numbers");
        return false;
    }
    /// What the child of that name has; nothing if there is none, or if it is faulty, which is reported.
    template <std::size_t count>
    std::optional<std::array<double, count>> numbersIn(const XmlElement& e, std::string_view name) {
        const XmlElement* child = tree_.child(e, name);
        std::array<double, count> numbers{};
        if (!child || !numbersOf(*child, numbers)) return std::nullopt;
        return numbers;
    }
    double numberIn(const XmlElement& e, std::string_view name, double otherwise) {
        const auto found = numbersIn<1>(e, name);
        return found ? (*found)[0] : otherwise;
    }
    std::string textIn(const XmlElement& e, std::string_view name) const {
        const XmlElement* child = tree_.child(e, name);
        return child ? child->text : std::string();
    }

    // ---- frames
    SdfFrame frameOf(const XmlElement& pose) {
        const std::string *format = pose.attribute("rotation_format"), *degrees = pose.attribute("degrees");
        if (pose.text.empty()) return {};
        if (format && *format == "quat_xyzw") {
            std::array<double, 7> n{};
            if (!numbersOf(pose, n)) return {};
            const glm::dquat q(n[6], n[3], n[4], n[5]);
            return {{n[0], n[1], n[2]}, glm::dot(q, q) > 0 ? glm::normalize(q) : glm::dquat(1, 0, 0, 0)};
        }
        std::array<double, 6> n{};
        if (!numbersOf(pose, n)) return {};
        const double unit = degrees && (*degrees == "true" || *degrees == "1") ? kRadians : 1;
        return {{n[0], n[1], n[2]},
                rotationAround({0, 0, 1}, n[5] * unit) * rotationAround({0, 1, 0}, n[4] * unit) *
                    rotationAround({1, 0, 0}, n[3] * unit)};
    }
    /// In the model's frame. `otherwise`: the frame that a pose is in which names none.
    SdfFrame placed(const XmlElement& e, const std::string& otherwise, std::size_t depth = 0) {
        const XmlElement* pose = tree_.child(e, "pose");
        const std::string* named = pose ? pose->attribute("relative_to") : nullptr;
        if (!named && pose) named = pose->attribute("frame");  // before 1.7
        const SdfFrame own = pose ? frameOf(*pose) : SdfFrame();
        const std::string& in = named && !named->empty() ? *named : otherwise;
        return frameCalled(in, pose ? *pose : e, depth) * own;
    }
    SdfFrame frameCalled(const std::string& name, const XmlElement& asker, std::size_t depth) {
        if (name.empty() || name == "__model__" || name == "world") return {};
        if (const auto known = placedFrames_.find(name); known != placedFrames_.end()) return known->second;
        const auto found = frames_.find(name);
        if (found == frames_.end()) return error(asker, "there is no frame " + name), SdfFrame();
        if (depth > kDeepestFrame) return error(asker, "frame " + name + " is in itself"), SdfFrame();
        const XmlElement& e = *found->second;
        const SdfFrame frame = placed(e,
                                      e.name == "joint"   ? textIn(e, "child")
                                      : e.name == "frame" ? attachedTo(e)
                                                          : "",
                                      depth + 1);
        placedFrames_.emplace(name, frame);
        return frame;
    }
    static std::string attachedTo(const XmlElement& frame) {
        const std::string* to = frame.attribute("attached_to");
        return to ? *to : std::string();
    }

    // ---- models
    void addModel(const XmlElement& e, const SdfFrame& around, const std::string& prefix, std::size_t depth = 0) {
        if (depth > kDeepestFrame) return error(e, named(e) + "models stand too deeply in each other");
        const auto framesBefore = std::exchange(frames_, {});
        const auto placedBefore = std::exchange(placedFrames_, {});
        const auto linksBefore = std::exchange(links_, {});
        const XmlElement* pose = tree_.child(e, "pose");
        const SdfFrame model = around * (pose ? frameOf(*pose) : SdfFrame());
        for (const char* kind : {"link", "joint", "frame"})
            tree_.forEach(e, kind, [&](const XmlElement& one) { frames_.emplace(nameOf(one), &one); });
        const std::string start = prefix.empty() ? "" : prefix + "_";
        std::vector<const XmlElement*> joints;
        std::map<std::string, const XmlElement*> endsIn;  // by the child
        tree_.forEach(e, "joint", [&](const XmlElement& joint) {
            const std::string child = textIn(joint, "child");
            if (!frames_.contains(child) || frames_.at(child)->name != "link")
                return error(joint, named(joint) + "there is no link " + child + "; it is left out");
            if (!endsIn.emplace(child, &joint).second)
                return error(joint, named(joint) + "another joint ends in link " + child + "; it is left out");
            joints.push_back(&joint);
        });
        tree_.forEach(e, "link", [&](const XmlElement& link) {
            const auto joint = endsIn.find(nameOf(link));
            addLink(link, start, joint == endsIn.end() ? placed(link, "") : placed(*joint->second, nameOf(link)));
        });
        for (const XmlElement* joint : joints) addJoint(*joint, start, model);
        for (const auto& [name, link] : links_)
            if (!endsIn.contains(name)) fix(link.number, model * link.frame, frames_.at(name)->where);
        breakCircles(e, endsIn);
        tree_.forEach(e, "model",
                      [&](const XmlElement& inner) { addModel(inner, model, start + nameOf(inner), depth + 1); });
        countOthers(e, {"link", "joint", "frame", "pose", "model", "static", "self_collide", "allow_auto_disable"});
        frames_ = framesBefore;
        placedFrames_ = placedBefore;
        links_ = linksBefore;
    }
    /// Hangs a link on the one that all hang on.
    void fix(std::uint32_t link, const SdfFrame& frame, SourceLocation where) {
        UrdfJoint joint;
        joint.name = model_.links[link].name + "_place";
        joint.child = link;
        joint.origin = frame.pose();
        joint.where = where;
        link_(0).joints.push_back(static_cast<std::uint32_t>(model_.joints.size()));
        model_.joints.push_back(std::move(joint));
    }
    UrdfLink& link_(std::uint32_t number) { return model_.links[number]; }

    void addLink(const XmlElement& e, const std::string& prefix, const SdfFrame& frame) {
        UrdfLink link;
        link.name = prefix + nameOf(e);
        link.where = e.where;
        const std::string name = nameOf(e);
        const SdfFrame inside = frame.inverse();
        tree_.forEach(e, "visual",
                      [&](const XmlElement& one) { addShape(one, inside * placed(one, name), link.visuals); });
        tree_.forEach(e, "collision",
                      [&](const XmlElement& one) { addShape(one, inside * placed(one, name), link.collisions); });
        countOthers(e, {"visual", "collision", "pose"});
        links_.emplace(name, Link{static_cast<std::uint32_t>(model_.links.size()), frame, {}});
        model_.links.push_back(std::move(link));
    }
    void addShape(const XmlElement& e, const SdfFrame& frame, std::vector<UrdfShape>& shapes) {
        UrdfShape shape;
        shape.where = e.where;
        shape.name = nameOf(e);
        const XmlElement* geometry = tree_.child(e, "geometry");
        if (!geometry || geometry->children.empty()) return error(e, named(e) + "it has no geometry; it is left out");
        SdfFrame own = frame;
        if (!readGeometry(tree_.elements()[geometry->children[0]], shape, own)) return;
        shape.origin = own.pose();
        if (const XmlElement* material = tree_.child(e, "material")) {
            if (const auto color = numbersIn<4>(*material, "diffuse"))
                shape.material = UrdfMaterial{{}, *color, {}};
            else if (!tree_.child(*material, "diffuse"))
                ++others_["materials without diffuse"];
        }
        shapes.push_back(std::move(shape));
    }
    bool readGeometry(const XmlElement& e, UrdfShape& shape, SdfFrame& frame) {
        using Kind = UrdfShape::Kind;
        const auto bad = [&](const char* what) {
            return error(e, e.name + ": it has no " + what + "; it is left out"), false;
        };
        const double radius = numberIn(e, "radius", 0), length = numberIn(e, "length", 0);
        if (e.name == "box") {
            const auto size = numbersIn<3>(e, "size");
            if (!size || std::ranges::any_of(*size, [](double n) { return !(n > 0); })) return bad("size");
            shape.size = *size;
        } else if (e.name == "sphere") {
            shape.kind = Kind::sphere;
            if (!(radius > 0)) return bad("radius");
            shape.size[0] = radius;
        } else if (e.name == "cylinder") {
            shape.kind = Kind::cylinder;
            if (!(radius > 0 && length > 0)) return bad("radius and length");
            shape.size[0] = radius, shape.size[1] = length;
        } else if (e.name == "plane") {
            // A thin box below it, with the normal as its z axis.
            constexpr double kThin = 1e-3;
            const auto size = numbersIn<2>(e, "size");
            const auto normal = numbersIn<3>(e, "normal").value_or(std::array<double, 3>{0, 0, 1});
            if (!size || !((*size)[0] > 0 && (*size)[1] > 0)) return bad("size");
            const glm::dvec3 up((normal)[0], (normal)[1], (normal)[2]);
            if (glm::length(up) > 0) frame = frame * SdfFrame{{}, rotationTo(glm::normalize(up))};
            frame = frame * SdfFrame{{0, 0, -kThin / 2}, {1, 0, 0, 0}};
            shape.size = {(*size)[0], (*size)[1], kThin};
        } else if (e.name == "mesh") {
            shape.kind = Kind::mesh;
            shape.mesh = textIn(e, "uri");
            if (shape.mesh.empty()) return bad("uri");
            shape.size = numbersIn<3>(e, "scale").value_or(std::array<double, 3>{1, 1, 1});
        } else {
            ++others_[e.name];
            return false;
        }
        return true;
    }

    // ---- joints
    void addJoint(const XmlElement& e, const std::string& prefix, const SdfFrame& model) {
        const std::string parent = textIn(e, "parent");
        const auto from = links_.find(parent);
        if (from == links_.end() && parent != "world")
            error(e, named(e) + "there is no link " + parent + "; the world is taken");
        Link& child = links_.at(textIn(e, "child"));
        child.joint = static_cast<std::uint32_t>(model_.joints.size());
        UrdfJoint joint;
        joint.name = prefix + nameOf(e);
        joint.where = e.where;
        joint.parent = from == links_.end() ? 0 : from->second.number;
        joint.child = child.number;
        joint.origin = (from == links_.end() ? model * child.frame : from->second.frame.inverse() * child.frame).pose();
        readKind(e, joint);
        if (const XmlElement* axis = tree_.child(e, "axis"); axis && joint.hasValue())
            readAxis(*axis, child.frame, joint);
        if (joint.kind == UrdfJoint::Kind::revolute && joint.upper - joint.lower > kMaxAngle)
            joint.kind = UrdfJoint::Kind::continuous;
        joint.start = joint.kind == UrdfJoint::Kind::continuous ? 0 : std::clamp(0.0, joint.lower, joint.upper);
        link_(joint.parent).joints.push_back(static_cast<std::uint32_t>(model_.joints.size()));
        model_.joints.push_back(std::move(joint));
        countOthers(e, {"parent", "child", "axis", "pose"});
    }
    void readKind(const XmlElement& e, UrdfJoint& joint) {
        using Kind = UrdfJoint::Kind;
        const std::string* type = e.attribute("type");
        joint.lower = -HUGE_VAL, joint.upper = HUGE_VAL;
        if (type && *type == "revolute")
            joint.kind = Kind::revolute;
        else if (type && *type == "continuous")
            joint.kind = Kind::continuous;
        else if (type && *type == "prismatic")
            joint.kind = Kind::prismatic, joint.lower = -kFarthest, joint.upper = kFarthest;
        else if (type && *type == "ball")
            joint.kind = Kind::floating;
        else if (!type || *type != "fixed")
            error(e, named(e) + (type ? "no joint of the kind " + *type + " is known here" : "it has no type") +
                         "; it is fixed");
    }
    void readAxis(const XmlElement& axis, const SdfFrame& frame, UrdfJoint& joint) {
        const XmlElement* xyz = tree_.child(axis, "xyz");
        glm::dvec3 along(0, 0, 1);
        if (std::array<double, 3> n{}; xyz && numbersOf(*xyz, n)) along = {n[0], n[1], n[2]};
        const std::string* in = xyz ? xyz->attribute("expressed_in") : nullptr;
        const std::string ofModel = textIn(axis, "use_parent_model_frame");  // before 1.7
        if (in && !in->empty())
            along = glm::conjugate(frame.rotation) * (frameCalled(*in, *xyz, 0).rotation * along);
        else if (ofModel == "1" || ofModel == "true")
            along = glm::conjugate(frame.rotation) * along;
        if (!(glm::length(along) > 0)) error(axis, "axis: it has no direction; z is taken"), along = {0, 0, 1};
        along = glm::normalize(along);
        joint.axis = {along.x, along.y, along.z};
        const XmlElement* limit = tree_.child(axis, "limit");
        if (!limit) return;
        joint.lower = std::max(joint.lower, numberIn(*limit, "lower", joint.lower));
        joint.upper = std::min(joint.upper, numberIn(*limit, "upper", joint.upper));
        if (joint.lower <= joint.upper) return;
        error(*limit, "limit: the lower one is above the upper one; they are exchanged");
        std::swap(joint.lower, joint.upper);
    }
    /// Joints whose links are below themselves hang on nothing: one of them is taken out.
    void breakCircles(const XmlElement& e, const std::map<std::string, const XmlElement*>& endsIn) {
        std::set<std::uint32_t> reached;
        const auto reach = [&](std::uint32_t from) {
            std::vector<std::uint32_t> open{from};
            while (!open.empty()) {
                const std::uint32_t link = open.back();
                open.pop_back();
                if (!reached.insert(link).second) continue;
                for (const std::uint32_t joint : link_(link).joints) open.push_back(model_.joints[joint].child);
            }
        };
        for (const auto& [name, link] : links_)
            if (!endsIn.contains(name) || (link.joint && model_.joints[*link.joint].parent == 0)) reach(link.number);
        for (const auto& [name, link] : links_) {
            if (reached.contains(link.number) || !link.joint) continue;
            UrdfJoint& joint = model_.joints[*link.joint];
            std::erase(link_(joint.parent).joints, *link.joint);
            joint.kind = UrdfJoint::Kind::fixed;  // it has no node
            error(e, named(e) + "its joints form a circle at link " + name + "; one is left out");
            fix(link.number, link.frame, e.where);
            reach(link.number);
        }
    }

    struct Link {
        std::uint32_t number = 0;
        SdfFrame frame;                        // in the model: of the joint that ends in it, or its own
        std::optional<std::uint32_t> joint{};  // that ends in it
    };
    std::map<std::string, const XmlElement*> frames_;  // of the present model: links, joints, frames
    std::map<std::string, SdfFrame> placedFrames_;     // the same, in the model
    std::map<std::string, Link> links_;
};

}  // namespace

bool readSdf(std::string_view text, UrdfModel& model, Diagnostics& diagnostics) {
    return SdfReader(model, diagnostics).run(text);
}

}  // namespace rtsg::detail
