// Reads a URDF file: the elements as links and joints, and then their hierarchy.
#include "urdf_model.h"

#include <algorithm>
#include <span>
#include <unordered_map>

#include "robot_reader.h"

namespace rtsg::detail {

namespace {

constexpr double kFullTurn = 6.283185307179586;
constexpr double kMaxRotations = 64;  // of a joint with limits; others have written huge limits for none

class UrdfReader : private RobotReader {
  public:
    using RobotReader::RobotReader;

    bool run(std::string_view text) {
        if (!tree_.read(text, diagnostics_) || isUnexpanded()) return false;
        const XmlElement& robot = tree_.root();
        if (const std::string* name = robot.attribute("name"))
            model_.name = *name;
        else
            error(robot, "the robot has no name");
        tree_.forEach(robot, "material", [&](const XmlElement& e) { keepMaterial(e); });
        tree_.forEach(robot, "link", [&](const XmlElement& e) { addLink(e); });
        tree_.forEach(robot, "joint", [&](const XmlElement& e) { addJoint(e); });
        countOthers(robot, {"material", "link", "joint"});
        if (model_.links.empty()) {
            error(robot, "the robot has no links");
            return false;
        }
        breakCircles();
        findMimics();
        std::erase_if(others_, [](const auto& one) { return one.first.starts_with("xacro:"); });  // reported already
        reportOthers();
        return true;
    }

  private:
    // ---- reports
    /// "link arm: ", for messages.
    static std::string named(const XmlElement& e) {
        const std::string* name = e.attribute("name");
        return e.name + (name && !name->empty() ? " " + *name : "") + ": ";
    }
    /// Whether the file has to go through xacro first: its numbers are expressions. Elements of xacro alone are left
    /// out.
    bool isUnexpanded() {
        const XmlElement* macro = nullptr;
        std::size_t count = 0;
        for (const XmlElement& e : tree_.elements()) {
            const bool isExpression = std::ranges::any_of(e.attributes, [](const auto& attribute) {
                return attribute.second.contains("${") || attribute.second.contains("$(");
            });
            if (isExpression) {
                error(e, "an expression of xacro: `xacro FILE > robot.urdf` makes a URDF file of this one");
                return true;
            }
            if (e.name.starts_with("xacro:") && count++ == 0) macro = &e;
        }
        if (macro)
            error(*macro, macro->name + ": a macro that is not expanded" +
                              (count > 1 ? ", the first of " + std::to_string(count) : "") +
                              "; it is left out, unless `xacro FILE > robot.urdf` makes a URDF file of this one");
        return false;
    }

    // ---- numbers
    static bool numbersOf(std::string_view text, std::span<double> numbers) {
        for (double& number : numbers)
            if (!takeNumber(text, number)) return false;
        skipBlanks(text);
        return text.empty();
    }
    /// Leaves `numbers` as they are, and false, if there is no such attribute; if it is faulty, that is reported.
    bool read(const XmlElement& e, std::string_view attribute, std::span<double> numbers) {
        const std::string* text = e.attribute(attribute);
        if (!text) return false;
        std::array<double, 4> found{};
        if (numbersOf(*text, std::span(found).first(numbers.size()))) {
            std::ranges::copy(std::span(found).first(numbers.size()), numbers.begin());
            return true;
        }
        error(e, e.name + ": " + std::string(attribute) + "=\"" + text->substr(0, 60) + "\": expected " +
                     (numbers.size() == 1 ? "a number" : std::to_string(numbers.size()) + " numbers"));
        return false;
    }
    bool read(const XmlElement& e, std::string_view attribute, double& number) {
        return read(e, attribute, std::span(&number, 1));
    }
    UrdfPose poseOf(const XmlElement& e) {
        UrdfPose pose;
        if (const XmlElement* origin = tree_.child(e, "origin")) {
            read(*origin, "xyz", pose.xyz);
            read(*origin, "rpy", pose.rpy);
        }
        return pose;
    }

    // ---- looks
    UrdfMaterial materialOf(const XmlElement& e) {
        UrdfMaterial material;
        if (const std::string* name = e.attribute("name")) material.name = *name;
        if (const XmlElement* color = tree_.child(e, "color")) {
            std::array<double, 4> rgba{0, 0, 0, 1};
            if (read(*color, "rgba", rgba)) material.color = rgba;
            if (std::ranges::any_of(rgba, [](double n) { return n < 0 || n > 1; }))
                warning(*color, "color: its numbers are from 0 to 1; what is beyond is taken as that");
        }
        if (const XmlElement* texture = tree_.child(e, "texture"))
            if (const std::string* file = texture->attribute("filename")) material.texture = *file;
        return material;
    }
    static bool isDefined(const UrdfMaterial& material) { return material.color || !material.texture.empty(); }
    void keepMaterial(const XmlElement& e) {
        const UrdfMaterial material = materialOf(e);
        if (!materials_.try_emplace(material.name, material).second) error(e, named(e) + "there is one of that name");
    }
    std::optional<UrdfMaterial> lookOf(const XmlElement& visual) {
        const XmlElement* e = tree_.child(visual, "material");
        if (!e) return std::nullopt;
        UrdfMaterial material = materialOf(*e);
        if (isDefined(material)) {
            // Materials that one link defines can be named by others.
            materials_.try_emplace(material.name, material);
            return material;
        }
        if (const auto known = materials_.find(material.name); known != materials_.end()) return known->second;
        if (e->children.empty()) error(*e, named(*e) + "nothing defines it");
        return std::nullopt;
    }
    bool hasSize(const XmlElement& e, std::span<const double> numbers) {
        if (std::ranges::all_of(numbers, [](double n) { return n > 0; })) return true;
        // Files have bodies of no size in place of none.
        if (std::ranges::all_of(numbers, [](double n) { return n >= 0; }))
            warning(e, e.name + ": it has no size; it is left out");
        else
            error(e, e.name + ": sizes are greater than 0; it is left out");
        return false;
    }
    /// False: nothing can be shown.
    bool readGeometry(const XmlElement& e, UrdfShape& shape) {
        shape.where = e.where;
        double &first = shape.size[0], &second = shape.size[1];
        if (e.name == "box") return read(e, "size", shape.size) ? hasSize(e, shape.size) : isIncomplete(e, "size");
        if (e.name == "sphere") {
            shape.kind = UrdfShape::Kind::sphere;
            return read(e, "radius", first) ? hasSize(e, std::span(shape.size).first(1)) : isIncomplete(e, "radius");
        }
        if (e.name == "cylinder") {
            shape.kind = UrdfShape::Kind::cylinder;
            if (!read(e, "radius", first)) return isIncomplete(e, "radius");
            if (!read(e, "length", second)) return isIncomplete(e, "length");
            return hasSize(e, std::span(shape.size).first(2));
        }
        if (e.name != "mesh") {
            error(e, e.name + ": no kind of geometry that is known; there are box, cylinder, sphere and mesh");
            return false;
        }
        shape.kind = UrdfShape::Kind::mesh;
        if (read(e, "scale", shape.size) && std::ranges::any_of(shape.size, [](double n) { return n == 0; }))
            error(e, "mesh: its scale has a 0, so that nothing of it is seen");
        const std::string* file = e.attribute("filename");
        if (!file || file->empty()) return isIncomplete(e, "filename");
        shape.mesh = *file;
        return true;
    }
    /// An attribute that is present but invalid has been reported already.
    bool isIncomplete(const XmlElement& e, std::string_view attribute) {
        if (const std::string* given = e.attribute(attribute); !given || given->empty())
            error(e, e.name + ": it has no " + std::string(attribute) + "; it is left out");
        return false;
    }
    void addShape(const XmlElement& e, bool isVisual, std::vector<UrdfShape>& shapes) {
        UrdfShape shape;
        shape.where = e.where;
        if (const std::string* name = e.attribute("name")) shape.name = *name;
        shape.origin = poseOf(e);
        if (isVisual) shape.material = lookOf(e);
        const XmlElement* geometry = tree_.child(e, "geometry");
        if (!geometry || geometry->children.empty()) return error(e, e.name + ": it has no geometry; it is left out");
        if (readGeometry(tree_.elements()[geometry->children.front()], shape)) shapes.push_back(std::move(shape));
        countOthers(e, {"origin", "geometry", "material"});
    }

    // ---- links and joints
    /// Null, and reported: no name, or one that another has.
    template <class Map>
    const std::string* nameOf(const XmlElement& e, const Map& known) {
        const std::string* name = e.attribute("name");
        if (name && !name->empty() && !known.contains(*name)) return name;
        error(e, name && !name->empty() ? named(e) + "there is one of that name already; it is left out"
                                        : e.name + ": it has no name, and is left out");
        return nullptr;
    }
    void addLink(const XmlElement& e) {
        const std::string* name = nameOf(e, links_);
        if (!name) return;
        links_.emplace(*name, static_cast<std::uint32_t>(model_.links.size()));
        UrdfLink link;
        link.name = *name;
        link.where = e.where;
        tree_.forEach(e, "visual", [&](const XmlElement& v) { addShape(v, true, link.visuals); });
        tree_.forEach(e, "collision", [&](const XmlElement& c) { addShape(c, false, link.collisions); });
        countOthers(e, {"visual", "collision"});
        model_.links.push_back(std::move(link));
        endsIn_.push_back(false);
    }
    /// Nothing, and reported: the joint names no such link.
    std::optional<std::uint32_t> linkOf(const XmlElement& joint, std::string_view which) {
        const XmlElement* e = tree_.child(joint, which);
        const std::string* name = e ? e->attribute("link") : nullptr;
        if (!name) {
            error(joint, named(joint) + "it names no " + std::string(which) + " link; it is left out");
            return std::nullopt;
        }
        if (const auto found = links_.find(*name); found != links_.end()) return found->second;
        error(*e, named(joint) + "there is no link " + *name + "; it is left out");
        return std::nullopt;
    }
    bool readKind(const XmlElement& e, UrdfJoint& joint) {
        constexpr std::pair<std::string_view, UrdfJoint::Kind> kinds[] = {
            {"fixed", UrdfJoint::Kind::fixed},           {"revolute", UrdfJoint::Kind::revolute},
            {"continuous", UrdfJoint::Kind::continuous}, {"prismatic", UrdfJoint::Kind::prismatic},
            {"floating", UrdfJoint::Kind::floating},     {"planar", UrdfJoint::Kind::planar}};
        const std::string* type = e.attribute("type");
        for (const auto& [name, kind] : kinds)
            if (type && *type == name) {
                joint.kind = kind;
                return true;
            }
        error(e, named(e) + (type ? "no kind of joint is called " + *type : "it has no type") + "; it is fixed here");
        return false;
    }
    void readAxis(const XmlElement& e, UrdfJoint& joint) {
        const XmlElement* axis = tree_.child(e, "axis");
        if (!axis || !joint.hasValue()) return;
        std::array<double, 3> given = joint.axis;
        read(*axis, "xyz", given);
        const double length = std::sqrt(given[0] * given[0] + given[1] * given[1] + given[2] * given[2]);
        if (!(length > 0)) return error(*axis, named(e) + "its axis has no direction; x is taken");
        for (double& one : given) one /= length;
        joint.axis = given;
    }
    void readLimits(const XmlElement& e, UrdfJoint& joint) {
        if (joint.kind != UrdfJoint::Kind::revolute && joint.kind != UrdfJoint::Kind::prismatic) return;
        const XmlElement* limit = tree_.child(e, "limit");
        if (!limit) return error(e, named(e) + "it has no limit, so it does not move");
        read(*limit, "lower", joint.lower);
        read(*limit, "upper", joint.upper);
        if (joint.lower > joint.upper) {
            error(*limit, named(e) + "its lower limit is above the upper one; they are exchanged");
            std::swap(joint.lower, joint.upper);
        }
        if (joint.lower == joint.upper) warning(*limit, named(e) + "its limits are the same, so it does not move");
        const bool isEndless =
            joint.kind == UrdfJoint::Kind::revolute && joint.upper - joint.lower > kMaxRotations * kFullTurn;
        if (!isEndless) return;
        warning(*limit, named(e) + "its limits are more than 64 turns apart; it has none here");
        joint.kind = UrdfJoint::Kind::continuous;
    }
    void addJoint(const XmlElement& e) {
        const std::string* name = nameOf(e, joints_);
        if (!name) return;
        UrdfJoint joint;
        joint.name = *name;
        joint.where = e.where;
        const auto parent = linkOf(e, "parent"), child = linkOf(e, "child");
        if (!parent || !child) return;
        if (endsIn_[*child])
            return error(e, named(e) + "another joint ends in link " + model_.links[*child].name + "; it is left out");
        joint.parent = *parent;
        joint.child = *child;
        joint.origin = poseOf(e);
        if (readKind(e, joint)) {
            readAxis(e, joint);
            readLimits(e, joint);
        }
        endsIn_[*child] = true;
        const auto number = static_cast<std::uint32_t>(model_.joints.size());
        joints_.emplace(*name, number);
        if (const XmlElement* mimic = tree_.child(e, "mimic"); mimic && joint.hasValue())
            mimics_.emplace_back(number, mimic);
        model_.links[*parent].joints.push_back(number);
        model_.joints.push_back(std::move(joint));
        countOthers(e, {"origin", "parent", "child", "axis", "limit", "mimic"});
    }

    // ---- how it hangs together
    /// Links of which each is below the others are below no root: one of their joints is taken out.
    void breakCircles() {
        std::vector<bool> reached(model_.links.size());
        const auto reach = [&](std::uint32_t from) {
            std::vector<std::uint32_t> open{from};
            while (!open.empty()) {
                const std::uint32_t link = open.back();
                open.pop_back();
                reached[link] = true;
                std::erase_if(model_.links[link].joints, [&](std::uint32_t joint) {
                    const UrdfJoint& one = model_.joints[joint];
                    if (!reached[one.child]) return open.push_back(one.child), false;
                    diagnostics_.error(one.where,
                                       "joint " + one.name + ": it closes a circle of links; it is left out");
                    model_.joints[joint].kind = UrdfJoint::Kind::fixed;  // nothing mimics it
                    return true;
                });
            }
        };
        const auto number = static_cast<std::uint32_t>(model_.links.size());
        for (std::uint32_t link = 0; link < number; ++link) {
            if (endsIn_[link]) continue;
            if (!model_.roots.empty())
                diagnostics_.error(model_.links[link].where, "link " + model_.links[link].name +
                                                                 ": no joint ends in it, nor in link " +
                                                                 model_.links[model_.roots[0]].name);
            model_.roots.push_back(link);
            reach(link);
        }
        for (std::uint32_t link = 0; link < number; ++link) {
            if (reached[link]) continue;
            model_.roots.push_back(link);
            reach(link);
        }
    }
    /// The limits that a joint can have.
    static std::pair<double, double> rangeOf(const UrdfJoint& joint) {
        if (joint.kind == UrdfJoint::Kind::continuous) return {-HUGE_VAL, HUGE_VAL};
        return {joint.lower, joint.upper};
    }
    void findMimics() {
        std::vector<std::uint32_t> waiting;
        for (const auto& [number, e] : mimics_) {
            UrdfJoint& joint = model_.joints[number];
            if (!joint.hasValue()) continue;
            const std::string* name = e->attribute("joint");
            const auto found = name ? joints_.find(*name) : joints_.end();
            const bool has = found != joints_.end() && model_.joints[found->second].hasValue();
            if (!has) {
                error(*e,
                      "joint " + joint.name + ": " +
                          (name ? "it mimics " + *name + ", which is no joint that moves" : "mimic names no joint"));
                continue;
            }
            UrdfJoint::Mimic mimic{found->second};
            read(*e, "multiplier", mimic.multiplier);
            read(*e, "offset", mimic.offset);
            joint.mimic = mimic;
            waiting.push_back(number);
        }
        for (UrdfJoint& joint : model_.joints) joint.start = clamped(joint, 0);
        orderMimics(waiting);
    }
    static double clamped(const UrdfJoint& joint, double value) {
        const auto [lower, upper] = rangeOf(joint);
        return std::clamp(value, lower, upper);
    }
    /// Joints whose leaders are known come first; the rest form a cycle.
    void orderMimics(const std::vector<std::uint32_t>& waiting) {
        std::vector<std::vector<std::uint32_t>> followers(model_.joints.size());
        std::vector<std::uint32_t> open;
        for (const std::uint32_t number : waiting) {
            followers[model_.joints[number].mimic->joint].push_back(number);
            if (!model_.joints[model_.joints[number].mimic->joint].mimic)
                open.push_back(model_.joints[number].mimic->joint);
        }
        std::vector<bool> known(model_.joints.size());
        while (!open.empty()) {
            const std::uint32_t leader = open.back();
            open.pop_back();
            if (known[leader]) continue;
            known[leader] = true;
            if (model_.joints[leader].mimic) model_.mimicOrder.push_back(leader);
            for (const std::uint32_t follower : followers[leader]) {
                UrdfJoint& joint = model_.joints[follower];
                joint.start =
                    clamped(joint, joint.mimic->multiplier * model_.joints[leader].start + joint.mimic->offset);
                open.push_back(follower);
            }
        }
        for (const std::uint32_t number : waiting) {
            UrdfJoint& joint = model_.joints[number];
            if (known[number]) continue;
            diagnostics_.error(joint.where, "joint " + joint.name + ": it mimics in a circle, and moves alone here");
            joint.mimic.reset();
        }
    }

    std::unordered_map<std::string, UrdfMaterial> materials_;
    std::unordered_map<std::string, std::uint32_t> links_, joints_;
    std::vector<bool> endsIn_;  // whether a joint ends in the link
    std::vector<std::pair<std::uint32_t, const XmlElement*>> mimics_;
};

}  // namespace

bool readUrdf(std::string_view text, UrdfModel& model, Diagnostics& diagnostics) {
    return UrdfReader(model, diagnostics).run(text);
}

}  // namespace rtsg::detail
