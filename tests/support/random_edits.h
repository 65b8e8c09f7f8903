// Seeded random edits of a scene: creation, deletion, re-parenting, sharing, routes, names, values, events.
#pragma once

#include <random>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

namespace rtsg::test {

class RandomEdits {
  public:
    /// `top`: the group below which edits take place; none: the root.
    RandomEdits(Scene& scene, std::uint64_t seed, NodeId top = {})
        : scene_(scene), random_(seed), top_(top ? top : scene.root()) {}

    /// From now on a node that is there may be edited, moved and destroyed like those made here.
    void adopt(NodeId id) { nodes_.push_back(id); }

    /// One edit; edits that the scene refuses (cycles, say) count as done.
    void step() {
        switch (pick(14)) {
            case 0:
            case 1:
            case 2:
                create();
                break;
            case 3:
                if (nodes_.size() > 8) destroy();
                break;
            case 4:
                insert();
                break;
            case 5:
                remove();
                break;
            case 6:
                replaceChildren();
                break;
            case 7:
                route();
                break;
            case 8:
                unroute();
                break;
            case 9:
                rename();
                break;
            case 10:
                event();
                break;
            default:
                setValue();
                break;
        }
    }
    const std::vector<NodeId>& nodes() const { return nodes_; }

  private:
    std::size_t pick(std::size_t n) { return random_() % n; }
    float number() { return static_cast<float>(static_cast<int>(pick(2001)) - 1000) / 64.0f; }
    NodeId any() { return nodes_.empty() ? top_ : nodes_[pick(nodes_.size())]; }

    /// A group or the top.
    std::pair<NodeId, FieldIndex> anyParent() {
        for (int tries = 0; tries < 8; ++tries) {
            const NodeId id = any();
            const FieldIndex children = scene_.node(id).type().findExact("children");
            if (children != kNoField) return {id, children};
        }
        return {top_, scene_.node(top_).type().findExact("children")};
    }
    void create() {
        static constexpr TypeIndex kinds[] = {
            x3d::Transform::type,  x3d::Group::type,      x3d::Shape::type,      x3d::Box::type,
            x3d::Switch::type,     x3d::Sphere::type,     x3d::TimeSensor::type, x3d::PositionInterpolator::type,
            x3d::Viewpoint::type,  x3d::Material::type,   x3d::PointLight::type, x3d::IndexedFaceSet::type,
            x3d::Appearance::type, x3d::Coordinate::type, x3d::Transform::type,  x3d::Shape::type};
        const NodeId id = scene_.createNode(kinds[pick(std::size(kinds))]);
        nodes_.push_back(id);
        if (pick(4)) {
            const auto [parent, field] = anyParent();
            (void)scene_.insertChild(parent, field, id, pick(3) ? SIZE_MAX : pick(4));
        }
    }
    void destroy() {
        const std::size_t i = pick(nodes_.size());
        (void)scene_.destroyNode(nodes_[i]);
        nodes_.erase(nodes_.begin() + static_cast<std::ptrdiff_t>(i));
    }
    void insert() {
        const auto [parent, field] = anyParent();
        if (!nodes_.empty()) (void)scene_.insertChild(parent, field, any(), pick(6));
    }
    void remove() {
        const auto [parent, field] = anyParent();
        (void)scene_.removeChild(parent, field, pick(4));
    }
    void replaceChildren() {
        const auto [parent, field] = anyParent();
        Array<NodeId> children;
        for (std::size_t i = pick(4); i > 0 && !nodes_.empty(); --i) children.push_back(any());
        (void)scene_.setField(parent, field, children);
    }
    void route() {
        const Node &a = scene_.node(any()), &b = scene_.node(any());
        if (a.type().fields.empty() || b.type().fields.empty()) return;
        for (int tries = 0; tries < 30; ++tries) {
            const auto from = static_cast<FieldIndex>(pick(a.type().fields.size()));
            const auto to = static_cast<FieldIndex>(pick(b.type().fields.size()));
            const FieldDef &x = a.type().fields[from], &y = b.type().fields[to];
            if (x.hidden || y.hidden || sf(x.type) == FieldType::SFNode) continue;
            if (scene_.addRoute(a.id(), from, b.id(), to)) return;
        }
    }
    void unroute() {
        const auto routes = scene_.routesFrom(any());
        if (routes.empty()) return;
        const Route& r = routes[pick(routes.size())];
        (void)scene_.removeRoute(r.fromNode, r.fromField, r.toNode, r.toField);
    }
    void rename() {
        static constexpr const char* names[] = {"A", "B", "C", "D", ""};
        if (!nodes_.empty()) (void)scene_.setName(any(), names[pick(5)]);
    }
    Value value(const FieldDef& def) {
        switch (def.type) {
            case FieldType::SFBool:
                return pick(2) == 0;
            case FieldType::SFInt32:
                return static_cast<std::int32_t>(pick(5)) - 1;
            case FieldType::SFFloat:
                return number();
            case FieldType::SFTime:
                return Time{std::abs(static_cast<double>(number()))};
            case FieldType::SFVec3f:
                return Vec3f(number(), number(), number());
            case FieldType::SFColor:
                return Color{.25f, number(), .5f};
            case FieldType::SFRotation:
                return Rotation{0, 1, 0, number()};
            case FieldType::SFString:
                return String(pick(2) ? "text" : "");
            case FieldType::MFFloat:
                return Array<float>{0, .5f, 1};
            case FieldType::MFVec3f:
                return Array<Vec3f>{Vec3f(number()), Vec3f(1), Vec3f(number())};
            case FieldType::MFInt32:
                return Array<std::int32_t>{0, 1, static_cast<std::int32_t>(pick(3)), -1};
            case FieldType::MFString:
                return Array<String>{String("a"), String(pick(2) ? "" : "b")};
            case FieldType::SFNode:
                return pick(4) ? any() : NodeId{};
            case FieldType::MFNode:
                return Array<NodeId>{any()};
            default:
                return Value::zero(def.type);
        }
    }
    void setValue() {
        const Node& node = scene_.node(any());
        if (node.id() == scene_.root() || node.type().fields.empty()) return;
        for (int tries = 0; tries < 8; ++tries) {
            const auto field = static_cast<FieldIndex>(pick(node.type().fields.size()));
            const FieldDef& def = node.type().fields[field];
            if (def.hidden) continue;
            Value v = value(def);
            if (def.type == FieldType::SFNode && v.as<NodeId>() == scene_.root()) continue;
            if (def.type == FieldType::MFNode && nodes_.empty()) continue;
            if (scene_.setField(node.id(), field, std::move(v))) return;
        }
    }
    void event() {
        const Node& node = scene_.node(any());
        if (node.id() == scene_.root() || node.type().fields.empty() || nodes_.empty()) return;
        const auto field = static_cast<FieldIndex>(pick(node.type().fields.size()));
        const FieldDef& def = node.type().fields[field];
        if (!def.hidden && def.writable()) (void)scene_.sendEvent(node.id(), field, value(def));
    }

    Scene& scene_;
    std::mt19937_64 random_;
    NodeId top_;
    std::vector<NodeId> nodes_;
};

}  // namespace rtsg::test
