// An independent flattening of a scene, recursive and without memory, and a subscriber that knows only the deltas.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/mesh.h>
#include <rtsg/renderers/shared_world.h>

namespace rtsg::test {

// ---- an independent flattening: recursive, from the scene alone ---------------------------------------------------

struct Flat {
    NodeId shape, geometry, appearance, acoustics;
    int layer = 0;
    bool castShadow = true, seen = true, heard = true;
    glm::dmat4 world{1.0};
    std::set<std::vector<NodeId>> lights;  // paths of the local lights that reach it
};
struct FlatPlaced {
    NodeId node;
    PlacedKind kind{};
    glm::dmat4 world{1.0};
};

/// One that bboxDisplay shows: around the corners of all triangles below, or as its author has it.
struct FlatBox {
    NodeId owner;
    int layer = 0;
    bool authored = false, seen = true;
    Vec3d min{HUGE_VAL}, max{-HUGE_VAL};
    double magnitude = 1;  // of the numbers that it was made of
    void extend(const glm::dmat4& world, Vec3f point) {
        const Vec3d at = world * Vec4d(Vec3d(point), 1);
        min = glm::min(min, at), max = glm::max(max, at);
        for (int c = 0; c < 4; ++c)
            for (int r = 0; r < 3; ++r) magnitude = std::max(magnitude, std::abs(world[c][r]));
    }
    double largest() const { return std::max({max.x - min.x, max.y - min.y, max.z - min.z}); }
};
using MeshesByNode = std::map<std::uint32_t, std::shared_ptr<const Mesh>>;

class Oracle {
  public:
    explicit Oracle(const Scene& scene, std::optional<Vec3d> viewer = {}, const MeshesByNode* meshes = nullptr)
        : scene_(scene), viewer_(viewer), meshes_(meshes) {}
    std::multimap<std::vector<NodeId>, Flat> shapes;
    std::multimap<std::vector<NodeId>, FlatBox> boxes;
    std::set<std::uint32_t> inBoxes;  // geometries, hidden ones too
    std::multimap<std::vector<NodeId>, FlatPlaced> placed;

    void run() {
        children(scene_.root(), glm::dmat4(1.0), {}, false, {}, 0, {});
        limitByInlines();
    }

  private:
    /// 9.4.2: a light that is not local reaches what is in the innermost Inline around it that is not global.
    void limitByInlines() {
        for (const auto& [path, light] : placed) {
            if (light.kind != PlacedKind::light || isLocalLight(scene_.node(light.node))) continue;
            std::size_t depth = path.size() - 1;
            const auto limits = [&](NodeId id) {
                const Node& n = scene_.node(id);
                return n.is(x3d::Inline::type) && !n.get(x3d::Inline::global);
            };
            while (depth > 0 && !limits(path[depth - 1])) --depth;
            if (depth == 0) continue;
            const auto end = path.begin() + static_cast<std::ptrdiff_t>(depth);
            for (auto& [shapePath, flat] : shapes)
                if (shapePath.size() > depth && std::equal(path.begin(), end, shapePath.begin()))
                    flat.lights.insert(path);
        }
    }
    using Lights = std::set<std::vector<NodeId>>;
    struct Senses {
        bool seen = true, heard = true, turned = false;
    };

    /// Billboards with axes that are 0 are not among the edits.
    glm::dmat4 towards(const Vec3d& axis, const glm::dmat4& world) const {
        WorldFromLocal affine;
        for (int c = 0; c < 4; ++c) affine[c] = Vec3d(world[c]);
        if (!viewer_ || determinantSign(affine) == 0) return glm::dmat4(1.0);
        const Vec3d a = glm::normalize(axis), eye = glm::inverse(world) * Vec4d(*viewer_, 1);
        // Two directions square to the axis: where the z axis shows, and a quarter turn on.
        const Vec3d z = Vec3d(0, 0, 1) - a.z * a;
        if (glm::length(z) < 1e-9) return glm::dmat4(1.0);
        const Vec3d first = glm::normalize(z), second = glm::cross(a, first);
        const double x = glm::dot(eye, first), y = glm::dot(eye, second);
        if (std::hypot(x, y) <= 1e-9 * glm::length(eye)) return glm::dmat4(1.0);
        return glm::rotate(glm::dmat4(1.0), std::atan2(y, x), a);
    }
    static glm::dmat4 rotation(const Rotation& r) {
        const Vec3d axis(r.x, r.y, r.z);
        return glm::length(axis) > 0 ? glm::rotate(glm::dmat4(1.0), double{r.angle}, axis) : glm::dmat4(1.0);
    }
    static glm::dmat4 matrix(Vec3f t, Vec3f c, const Rotation& r, Vec3f s, Rotation so) {
        const glm::dmat4 one(1.0);
        Rotation back = so;
        back.angle = -so.angle;
        return glm::translate(one, Vec3d(t)) * glm::translate(one, Vec3d(c)) * rotation(r) * rotation(so) *
               glm::scale(one, Vec3d(s)) * rotation(back) * glm::translate(one, -Vec3d(c));
    }
    std::vector<NodeId> below(const Node& n) {
        const auto list = [&](auto field) {
            const auto& a = n.get(field);
            return std::vector<NodeId>(a.begin(), a.end());
        };
        if (n.is(x3d::Group::type)) return list(x3d::Group::children);
        if (n.is(x3d::Transform::type)) return list(x3d::Transform::children);
        if (n.is(x3d::Collision::type)) return list(x3d::Collision::children);
        if (n.is(x3d::Anchor::type)) return list(x3d::Anchor::children);
        if (n.is(x3d::Billboard::type)) return list(x3d::Billboard::children);
        if (n.is(x3d::HAnimSite::type)) return list(x3d::HAnimSite::children);
        if (n.is(x3d::Inline::type)) return list(x3d::Inline::body);
        if (n.is(x3d::Layer::type)) return list(x3d::Layer::children);
        if (n.is(x3d::RtsgScene::type)) return list(x3d::RtsgScene::children);
        if (n.is(x3d::CADFace::type)) return {n.get(x3d::CADFace::shape)};
        if (n.is(x3d::Switch::type)) {
            const auto all = list(x3d::Switch::children);
            const int which = n.get(x3d::Switch::whichChoice);
            if (which < 0 || which >= static_cast<int>(all.size())) return {};
            return {all[static_cast<std::size_t>(which)]};
        }
        return {};
    }
    /// The visible level of an LOD is the one for the viewer; the audible one is the first.
    std::vector<std::pair<NodeId, Senses>> levels(const Node& n, const glm::dmat4& world, Senses above) {
        const auto& all = n.get(x3d::LOD::children);
        if (all.empty()) return {};
        std::size_t level = 0;
        WorldFromLocal affine;
        for (int c = 0; c < 4; ++c) affine[c] = Vec3d(world[c]);
        if (viewer_ && determinantSign(affine) != 0) {
            const Vec3d eye = glm::inverse(world) * Vec4d(*viewer_, 1);
            for (const float range : n.get(x3d::LOD::range)) {
                if (glm::length(eye - Vec3d(n.get(x3d::LOD::center))) < double{range}) break;
                ++level;
            }
        }
        const NodeId seen = all[std::min<std::size_t>(level, all.size() - 1)], heard = all[0];
        std::vector<std::pair<NodeId, Senses>> result;
        if (seen && above.seen) result.push_back({seen, {true, above.heard && seen == heard, above.turned}});
        if (heard && above.heard && (seen != heard || !above.seen))
            result.push_back({heard, {false, true, above.turned}});
        return result;
    }
    bool visible(const Node& n) {
        const FieldIndex f = n.type().findExact("visible");
        return f == kNoField || *static_cast<const bool*>(n.storage(f));
    }
    bool isLocalLight(const Node& n) {
        return (n.is(x3d::DirectionalLight::type) && !n.get(x3d::DirectionalLight::global)) ||
               (n.is(x3d::PointLight::type) && !n.get(x3d::PointLight::global));
    }
    void children(NodeId id, const glm::dmat4& world, std::vector<NodeId> path, bool hidden, Senses senses, int layer,
                  Lights lights) {
        const Node& n = scene_.node(id);
        const auto shineOn = [&](NodeId c) {
            auto p = path;
            p.push_back(c);
            lights.insert(p);
        };
        if (n.is(x3d::LayerSet::type)) {
            const auto& layers = n.get(x3d::LayerSet::layers);
            std::vector<NodeId> shown;
            for (const int i : n.get(x3d::LayerSet::order))
                if (i > 0 && i <= static_cast<int>(layers.size()))
                    shown.push_back(layers[static_cast<std::size_t>(i - 1)]);
            // The edits put in what is no Layer, too, as no document can: it counts as a child of a group does.
            for (const NodeId c : shown)
                if (!hidden && senses.seen && isLocalLight(scene_.node(c))) shineOn(c);
            for (const NodeId c : shown) {
                const auto* first = std::find(layers.begin(), layers.end(), c);
                visit(c, world, path, hidden, senses, static_cast<int>(first - layers.begin()) + 1, lights);
            }
            return;
        }
        std::vector<std::pair<NodeId, Senses>> list;
        if (n.is(x3d::LOD::type))
            list = levels(n, world, senses);
        else
            for (const NodeId c : below(n)) list.emplace_back(c, senses);
        // Lights at the top shine everywhere, which is not a scope to be told apart.
        if (id != scene_.root() && !hidden)
            for (const auto& [c, sensed] : list)
                if (c && sensed.seen && isLocalLight(scene_.node(c))) shineOn(c);
        for (const auto& [c, sensed] : list)
            if (c) visit(c, world, path, hidden, sensed, layer, lights);
    }
    void visit(NodeId id, glm::dmat4 world, std::vector<NodeId> path, bool hidden, Senses senses, int layer,
               const Lights& lights) {
        const Node& n = scene_.node(id);
        path.push_back(id);
        const bool framed = displaysBox(n);
        hidden = hidden || !visible(n);
        if (n.is(x3d::Transform::type))
            world = world * matrix(n.get(x3d::Transform::translation), n.get(x3d::Transform::center),
                                   n.get(x3d::Transform::rotation), n.get(x3d::Transform::scale),
                                   n.get(x3d::Transform::scaleOrientation));
        if (n.is(x3d::Billboard::type)) {
            world = world * towards(Vec3d(n.get(x3d::Billboard::axisOfRotation)), world);
            senses.turned = true;
        }
        if (n.is(x3d::HAnimSite::type))
            world = world * matrix(n.get(x3d::HAnimSite::translation), n.get(x3d::HAnimSite::center),
                                   n.get(x3d::HAnimSite::rotation), n.get(x3d::HAnimSite::scale),
                                   n.get(x3d::HAnimSite::scaleOrientation));
        if (framed) openBox(n, layer, senses.seen, world);
        if (n.is(x3d::Shape::type)) fillBoxes(n.get(x3d::Shape::geometry), world, senses.seen);
        if (n.is(x3d::Shape::type) && !hidden) {
            Flat flat;
            flat.shape = id;
            flat.geometry = n.get(x3d::Shape::geometry);
            flat.appearance = n.get(x3d::Shape::appearance);
            if (const Node* a = scene_.find(flat.appearance); a && a->is(x3d::Appearance::type))
                flat.acoustics = a->get(x3d::Appearance::acousticProperties);
            flat.castShadow = n.get(x3d::Shape::castShadow);
            flat.layer = layer;
            flat.seen = senses.seen, flat.heard = senses.heard && !(senses.turned && senses.seen);
            flat.world = world;
            flat.lights = lights;
            shapes.emplace(path, flat);
        }
        const bool light = n.is(x3d::DirectionalLight::type) || n.is(x3d::PointLight::type);
        if (light && !hidden && senses.seen) placed.emplace(path, FlatPlaced{id, PlacedKind::light, world});
        if (n.is(x3d::Viewpoint::type) && senses.seen) placed.emplace(path, FlatPlaced{id, PlacedKind::view, world});
        if (n.is(x3d::Sound::type) && senses.heard) placed.emplace(path, FlatPlaced{id, PlacedKind::sound, world});
        children(id, world, path, hidden, senses, layer, lights);
        if (!framed) return;
        if (const FlatBox& box = open_.back(); box.seen && box.largest() > 0) boxes.emplace(path, box);
        open_.pop_back();
    }
    static bool displaysBox(const Node& n) {
        const FieldIndex f = n.type().findExact("bboxDisplay");
        return f != kNoField && *static_cast<const bool*>(n.storage(f));
    }
    void openBox(const Node& n, int layer, bool seen, const glm::dmat4& world) {
        FlatBox box;
        box.owner = n.id(), box.layer = layer, box.seen = seen;
        const Vec3f size = *static_cast<const Vec3f*>(n.storage(n.type().findExact("bboxSize"))),
                    center = *static_cast<const Vec3f*>(n.storage(n.type().findExact("bboxCenter")));
        box.authored = size.x >= 0 && size.y >= 0 && size.z >= 0;  // other sizes are none
        for (int k = 0; box.authored && k < 8; ++k)
            box.extend(world, center + .5f * size * Vec3f(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1));
        open_.push_back(box);
    }
    void fillBoxes(NodeId geometry, const glm::dmat4& world, bool seen) {
        for (FlatBox& box : open_) {
            if (!geometry || box.authored) continue;
            inBoxes.insert(geometry.value);
            if (!meshes_ || !seen || !meshes_->contains(geometry.value)) continue;
            const Mesh& mesh = *meshes_->at(geometry.value);
            for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
                for (std::uint32_t c = 0; c < 3; ++c) box.extend(world, mesh.vertex(t, c));
        }
    }
    const Scene& scene_;
    std::optional<Vec3d> viewer_;
    const MeshesByNode* meshes_;
    std::vector<FlatBox> open_;
};

inline double difference(const glm::dmat4& a, const WorldFromLocal& b) {
    double worst = 0, size = 1;
    for (int c = 0; c < 4; ++c)
        for (int r = 0; r < 3; ++r) {
            worst = std::max(worst, std::abs(a[c][r] - b[c][r]));
            size = std::max(size, std::abs(a[c][r]));
        }
    return worst / size;
}

/// The knowledge of a subscriber that has only the deltas.
struct Follower {
    std::map<std::uint32_t, Instance> instances;
    std::map<std::uint32_t, Placed> placed;
    MeshesByNode meshes;
    std::map<std::uint32_t, std::uint32_t> scopes;
    std::set<InstanceId> everInstances, everPlaced;

    template <class Record>
    static void follow(std::map<std::uint32_t, Record>& all, const std::vector<InstanceId>& removed,
                       const std::vector<Record>& added, const std::vector<InstanceDelta::Moved>& moved,
                       const std::vector<Record>& rebound, std::set<InstanceId>& ever) {
        for (const InstanceId id : removed) {
            ASSERT_TRUE(all.contains(id.slot));
            ASSERT_EQ(all[id.slot].id, id);
            all.erase(id.slot);
        }
        std::set<std::uint32_t> fresh;
        for (const Record& r : added) {
            ASSERT_FALSE(all.contains(r.id.slot));
            ASSERT_TRUE(fresh.insert(r.id.slot).second);
            for (const InstanceId id : removed) ASSERT_NE(id.slot, r.id.slot) << "a slot is reused within a delta";
            ASSERT_TRUE(ever.insert(r.id).second) << "a slot's generation is another with each tenant";
            all[r.id.slot] = r;
        }
        for (const Record& r : rebound) {
            ASSERT_FALSE(fresh.contains(r.id.slot));
            ASSERT_EQ(all.at(r.id.slot).id, r.id);
            all[r.id.slot] = r;
        }
        for (const auto& m : moved) {
            ASSERT_FALSE(fresh.contains(m.id.slot));
            ASSERT_EQ(all.at(m.id.slot).id, m.id);
            all[m.id.slot].worldFromLocal = m.worldFromLocal;
        }
    }
    void apply(const InstanceDelta& delta) {
        for (const auto& s : delta.scopes) scopes[s.scope.value] = s.parent.value;
        for (const auto& g : delta.geometries) meshes[g.node.value] = g.mesh;
        follow(instances, delta.removed, delta.added, delta.moved, delta.rebound, everInstances);
        follow(placed, delta.placedRemoved, delta.placedAdded, delta.placedMoved, delta.placedRebound, everPlaced);
        for (const NodeId g : delta.geometriesRemoved) ASSERT_EQ(meshes.erase(g.value), 1u);
    }
};

inline void expectBox(const Instance& instance, const FlatBox& box, NodeId root) {
    EXPECT_EQ(instance.shape, box.owner);
    EXPECT_EQ(instance.geometry, root);
    EXPECT_EQ(instance.layer, box.layer);
    EXPECT_FALSE(instance.appearance || instance.acoustics || instance.heard || instance.castShadow);
    EXPECT_TRUE(instance.seen);
    const WorldFromLocal& m = instance.worldFromLocal;
    const double slack = 1e-11 * box.magnitude;
    for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(m[3][k], (box.min[k] + box.max[k]) / 2, slack);
        EXPECT_NEAR(m[k][k], std::max(box.max[k] - box.min[k], 0x1p-20 * box.largest()), slack);
        for (int other = 0; other < 3; ++other) EXPECT_TRUE(other == k || m[k][other] == 0) << "it is turned";
    }
}

inline void expectSame(const Scene& scene, const Flattener& flattener, const Follower& follower,
                       std::optional<Vec3d> viewer = {}) {
    Oracle oracle(scene, viewer, &follower.meshes);
    oracle.run();
    EXPECT_EQ(flattener.instanceCount(), oracle.shapes.size() + oracle.boxes.size());
    EXPECT_EQ(follower.instances.size(), oracle.shapes.size() + oracle.boxes.size());
    std::set<std::uint32_t> geometries = oracle.inBoxes;
    if (!oracle.boxes.empty()) geometries.insert(scene.root().value);
    std::map<std::uint32_t, std::vector<NodeId>> localLights;  // by placed slot
    for (const auto& [slot, p] : follower.placed) {
        const auto path = flattener.placedPath(p.id);
        EXPECT_EQ(flattener.placed()[slot].id, p.id);
        const auto found = oracle.placed.find(path);
        ASSERT_NE(found, oracle.placed.end());
        EXPECT_EQ(found->second.kind, p.kind);
        EXPECT_LT(difference(found->second.world, p.worldFromLocal), 1e-12);
        oracle.placed.erase(found);
        if (p.kind == PlacedKind::light && p.scope.value != 0) localLights[slot] = path;
    }
    EXPECT_TRUE(oracle.placed.empty());
    for (const auto& [slot, instance] : follower.instances) {
        const auto path = flattener.path(instance.id);
        EXPECT_EQ(flattener.instances()[slot].id, instance.id);
        ASSERT_FALSE(path.empty());
        if (instance.boundingBox) {
            const auto box = oracle.boxes.find(path);
            ASSERT_NE(box, oracle.boxes.end());
            expectBox(instance, box->second, scene.root());
            oracle.boxes.erase(box);
            continue;
        }
        const auto found = oracle.shapes.find(path);
        ASSERT_NE(found, oracle.shapes.end());
        const Flat& flat = found->second;
        EXPECT_EQ(instance.shape, flat.shape);
        EXPECT_EQ(instance.geometry, flat.geometry);
        EXPECT_EQ(instance.appearance, flat.appearance);
        EXPECT_EQ(instance.acoustics, flat.acoustics);
        EXPECT_EQ(instance.castShadow, flat.castShadow);
        EXPECT_EQ(instance.layer, flat.layer);
        EXPECT_EQ(instance.seen, flat.seen);
        EXPECT_EQ(instance.heard, flat.heard);
        EXPECT_LT(difference(flat.world, instance.worldFromLocal), 1e-12);
        std::set<std::vector<NodeId>> lights;
        for (const auto& [light, lightPath] : localLights) {
            std::uint32_t scope = instance.scope.value;
            for (int steps = 0; scope != 0 && steps < 1000; ++steps) {
                if (scope == follower.placed.at(light).scope.value) {
                    lights.insert(lightPath);
                    break;
                }
                ASSERT_TRUE(follower.scopes.contains(scope));
                EXPECT_EQ(follower.scopes.at(scope), flattener.scopeParent(ScopeId{scope}).value);
                scope = follower.scopes.at(scope);
            }
        }
        EXPECT_EQ(lights, flat.lights);
        if (instance.geometry) geometries.insert(instance.geometry.value);
        oracle.shapes.erase(found);
    }
    std::set<std::uint32_t> known;
    for (const auto& [node, mesh] : follower.meshes) known.insert(node);
    EXPECT_EQ(known, geometries);
}

/// Says which geometry it was made of, and counts.
struct Meshes {
    int created = 0;
    MeshSource source() {
        return [this](const Scene&, NodeId) {
            ++created;
            return std::make_shared<const Mesh>();
        };
    }
    /// The same with a triangle each, another one each time.
    MeshSource triangles() {
        return [this](const Scene&, NodeId geometry) {
            const auto mesh = std::make_shared<Mesh>();
            const auto size = 1 + .25f * static_cast<float>((geometry.value + static_cast<unsigned>(++created)) % 16);
            mesh->positions = {Vec3f(0, 0, -size), Vec3f(size, 0, 0), Vec3f(.5f, -size, 1)};
            mesh->triangles = {0, 1, 2};
            mesh->triangleCount = 1;
            for (const Vec3f& p : mesh->positions) mesh->bounds.extend(p);
            return mesh;
        };
    }
};

struct Watcher : InstanceSubscriber {
    Follower follower;
    InstanceDelta last;
    Result<> apply(const Scene&, const ChangeSet&, const InstanceDelta& delta) override {
        follower.apply(delta);
        last = delta;
        return {};
    }
};

}  // namespace rtsg::test
