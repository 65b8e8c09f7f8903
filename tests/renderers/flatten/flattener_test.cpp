// The Flattener: one instance a path, and small deltas for small changes, against flattening anew.
#include <rtsg/renderers/shared_world.h>

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <utility>

#include <glm/gtc/matrix_transform.hpp>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/mesh.h>

#include "renderers/scene_edits.h"

namespace rtsg {
namespace {

using test::Edits;

constexpr std::uint64_t kSeed = 20090616;

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

class Oracle {
  public:
    explicit Oracle(const Scene& scene, std::optional<Vec3d> viewer = {}) : scene_(scene), viewer_(viewer) {}
    std::multimap<std::vector<NodeId>, Flat> shapes;
    std::multimap<std::vector<NodeId>, FlatPlaced> placed;

    void run() { children(scene_.root(), glm::dmat4(1.0), {}, false, {}, 0, {}); }

  private:
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
    /// What is seen of an LOD is its level for the viewer, what is heard the first one.
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
        if (n.is(x3d::LayerSet::type)) {
            const auto& layers = n.get(x3d::LayerSet::layers);
            for (const int i : n.get(x3d::LayerSet::order))
                if (i > 0 && i <= static_cast<int>(layers.size())) {
                    const NodeId layerNode = layers[static_cast<std::size_t>(i - 1)];
                    const auto* first = std::find(layers.begin(), layers.end(), layerNode);
                    visit(layerNode, world, path, hidden, senses, static_cast<int>(first - layers.begin()) + 1, lights);
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
                if (c && sensed.seen && isLocalLight(scene_.node(c))) {
                    auto p = path;
                    p.push_back(c);
                    lights.insert(p);
                }
        for (const auto& [c, sensed] : list)
            if (c) visit(c, world, path, hidden, sensed, layer, lights);
    }
    void visit(NodeId id, glm::dmat4 world, std::vector<NodeId> path, bool hidden, Senses senses, int layer,
               const Lights& lights) {
        const Node& n = scene_.node(id);
        path.push_back(id);
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
    }
    const Scene& scene_;
    std::optional<Vec3d> viewer_;
};

double difference(const glm::dmat4& a, const WorldFromLocal& b) {
    double worst = 0, size = 1;
    for (int c = 0; c < 4; ++c)
        for (int r = 0; r < 3; ++r) {
            worst = std::max(worst, std::abs(a[c][r] - b[c][r]));
            size = std::max(size, std::abs(a[c][r]));
        }
    return worst / size;
}

/// What a subscriber knows that has only the deltas.
struct Follower {
    std::map<std::uint32_t, Instance> instances;
    std::map<std::uint32_t, Placed> placed;
    std::map<std::uint32_t, std::shared_ptr<const Mesh>> meshes;
    std::map<std::uint32_t, std::uint32_t> scopes;

    template <class Record>
    static void follow(std::map<std::uint32_t, Record>& all, const std::vector<InstanceId>& removed,
                       const std::vector<Record>& added, const std::vector<InstanceDelta::Moved>& moved,
                       const std::vector<Record>& rebound) {
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
        follow(instances, delta.removed, delta.added, delta.moved, delta.rebound);
        follow(placed, delta.placedRemoved, delta.placedAdded, delta.placedMoved, delta.placedRebound);
        for (const NodeId g : delta.geometriesRemoved) ASSERT_EQ(meshes.erase(g.value), 1u);
    }
};

void expectSame(const Scene& scene, const Flattener& flattener, const Follower& follower,
                std::optional<Vec3d> viewer = {}) {
    Oracle oracle(scene, viewer);
    oracle.run();
    EXPECT_EQ(flattener.instanceCount(), oracle.shapes.size());
    EXPECT_EQ(follower.instances.size(), oracle.shapes.size());
    std::set<std::uint32_t> geometries;
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

// ---- properties ---------------------------------------------------------------------------------------------------

/// Says which geometry it was made of, and counts.
struct Meshes {
    int made = 0;
    MeshSource source() {
        return [this](const Scene&, NodeId) {
            ++made;
            return std::make_shared<const Mesh>();
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

// Law 2: incremental equals from scratch.
TEST(Flattener, FollowsRandomEditsAsIfFlattenedAnew) {
    for (std::uint64_t seed = kSeed; seed < kSeed + 20; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        Scene scene;
        Edits edits(scene, seed);
        Meshes meshes;
        SharedWorld flat(scene, {.flattening = {.meshes = meshes.source()}, .rays = {}});
        Watcher watcher;
        flat.add(watcher);
        std::mt19937_64 random(seed);
        std::size_t compared = 0;
        for (int frame = 0; frame < 400; ++frame) {
            SCOPED_TRACE(frame);
            for (std::size_t n = frame ? 1 + random() % (frame % 20 ? 6 : 40) : 500; n > 0; --n) edits.step();
            scene.seal();
            ASSERT_EQ(flat.failure(), "");
            expectSame(scene, flat.flattener(), watcher.follower);
            if (testing::Test::HasFailure()) return;
            compared += watcher.follower.instances.size();
            if (frame % 50 ==
                49) {  // a late one, from a snapshot of the scene, and one from a snapshot of the instances
                Flattener late;
                Follower lateFollower;
                lateFollower.apply(late.apply(scene, scene.snapshot()));
                expectSame(scene, late, lateFollower);
                Follower joined;
                joined.apply(flat.flattener().snapshot());
                expectSame(scene, flat.flattener(), joined);
            }
        }
        EXPECT_GT(compared, 1000u);
    }
}

// The same with an eye that comes and goes, and LODs that have ranges.
TEST(Flattener, FollowsRandomEditsAndAnEyeAsIfFlattenedAnew) {
    std::size_t seenOnly = 0, heardOnly = 0;
    for (std::uint64_t seed = kSeed; seed < kSeed + 10; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        Scene scene;
        Edits edits(scene, seed);
        Meshes meshes;
        SharedWorld flat(scene, {.flattening = {.meshes = meshes.source()}, .rays = {}});
        Watcher watcher;
        flat.add(watcher);
        std::mt19937_64 random(seed);
        std::optional<Vec3d> viewer;
        for (int frame = 0; frame < 300; ++frame) {
            SCOPED_TRACE(frame);
            for (std::size_t n = frame ? 1 + random() % 6 : 500; n > 0; --n) edits.step();
            scene.forEachNode([&](const Node& node) {
                if (node.is(x3d::LOD::type) && (frame == 0 || random() % 16 == 0)) {
                    EXPECT_TRUE(
                        scene.set(node.id(), x3d::LOD::range, Array<float>{static_cast<float>(random() % 4), 4, 8}));
                }
            });
            if (random() % 3 == 0) {
                viewer.reset();
                if (random() % 5 != 0)
                    viewer = Vec3d(static_cast<double>(random() % 20), static_cast<double>(random() % 5), 0);
                ASSERT_TRUE(flat.setViewer(viewer));
            }
            scene.seal();
            ASSERT_EQ(flat.failure(), "");
            expectSame(scene, flat.flattener(), watcher.follower, viewer);
            if (testing::Test::HasFailure()) return;
            for (const auto& [slot, instance] : watcher.follower.instances) {
                EXPECT_TRUE(instance.seen || instance.heard);
                seenOnly += !instance.heard, heardOnly += !instance.seen;
            }
            if (frame % 50 == 49) {
                Flattener late;
                late.setViewer(viewer);
                Follower lateFollower;
                lateFollower.apply(late.apply(scene, scene.snapshot()));
                expectSame(scene, late, lateFollower, viewer);
            }
        }
    }
    EXPECT_GT(seenOnly, 200u);
    EXPECT_GT(heardOnly, 200u);
}

TEST(Flattener, MergedChangeSetsLeadToTheSame) {
    for (std::uint64_t seed = kSeed; seed < kSeed + 6; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        Scene scene;
        Edits edits(scene, seed);
        SharedWorld flat(scene, {.flattening = {}, .rays = {}, .delivery = Delivery::polled});
        Watcher watcher;
        flat.add(watcher);
        for (int frame = 0; frame < 120; ++frame) {
            for (int n = frame ? 5 : 600; n > 0; --n) edits.step();
            scene.seal();
            if (frame % 7 != 6) continue;
            ASSERT_TRUE(flat.update());
            expectSame(scene, flat.flattener(), watcher.follower);
            if (testing::Test::HasFailure()) return;
        }
    }
}

// ---- single cases -------------------------------------------------------------------------------------------------

struct Fixture : testing::Test {
    Scene scene;
    Meshes meshes;
    std::unique_ptr<SharedWorld> world = std::make_unique<SharedWorld>(
        scene, SharedWorld::Options{.flattening = {.meshes = meshes.source()}, .rays = {}});
    SharedWorld& flat = *world;
    Watcher watcher;
    void SetUp() override { flat.add(watcher); }
    NodeId add(TypeIndex type, NodeId parent) {
        const NodeId id = scene.createNode(type);
        const FieldIndex field = scene.node(parent).type().findExact("children");
        EXPECT_TRUE(scene.insertChild(parent, field, id));
        return id;
    }
    NodeId addShape(NodeId parent, TypeIndex geometry = x3d::Box::type) {
        const NodeId shape = add(x3d::Shape::type, parent);
        EXPECT_TRUE(scene.set(shape, x3d::Shape::geometry, scene.createNode(geometry)));
        EXPECT_TRUE(scene.set(shape, x3d::Shape::appearance, scene.createNode(x3d::Appearance::type)));
        return shape;
    }
    const InstanceDelta& seal() {
        watcher.last.clear();
        scene.seal();
        return watcher.last;
    }
};
using FlattenerCase = Fixture;

TEST_F(FlattenerCase, AMoveTouchesNothingElse) {
    const NodeId mover = add(x3d::Transform::type, scene.root());
    addShape(mover);
    for (int i = 0; i < 100; ++i) addShape(scene.root());
    seal();
    EXPECT_TRUE(scene.set(mover, x3d::Transform::translation, Vec3f(1, 2, 3)));
    ASSERT_EQ(seal().rebound.size(), 1u) << "that it has been seen to move";
    EXPECT_TRUE(scene.set(mover, x3d::Transform::translation, Vec3f(1, 2, 4)));
    const InstanceDelta& delta = seal();
    ASSERT_EQ(delta.moved.size(), 1u);
    EXPECT_EQ(delta.moved[0].worldFromLocal[3], Vec3d(1, 2, 4));
    EXPECT_TRUE(delta.added.empty() && delta.removed.empty() && delta.rebound.empty() && delta.geometries.empty());
    EXPECT_EQ(meshes.made, 101);
}

TEST_F(FlattenerCase, SharedNodeHasOneInstanceAPathAndOneMesh) {
    const NodeId shape = addShape(scene.root());
    for (int i = 0; i < 9; ++i) {
        const NodeId t = add(x3d::Transform::type, scene.root());
        EXPECT_TRUE(scene.set(t, x3d::Transform::translation, Vec3f(static_cast<float>(i))));
        EXPECT_TRUE(scene.insertChild(t, x3d::Transform::children.index, shape));
    }
    const InstanceDelta& delta = seal();
    EXPECT_EQ(delta.added.size(), 10u);
    EXPECT_EQ(delta.geometries.size(), 1u);
    EXPECT_EQ(meshes.made, 1);
}

TEST_F(FlattenerCase, ContentChangesNameTheNodesThatShapesReferTo) {
    const NodeId shape = addShape(scene.root(), x3d::IndexedFaceSet::type);
    const NodeId other = addShape(scene.root());
    const NodeId faces = scene.node(shape).get(x3d::Shape::geometry);
    const NodeId look = scene.node(shape).get(x3d::Shape::appearance);
    const NodeId coord = scene.createNode(x3d::Coordinate::type), material = scene.createNode(x3d::Material::type);
    const NodeId light = add(x3d::PointLight::type, scene.root());
    EXPECT_TRUE(scene.set(faces, x3d::IndexedFaceSet::coord, coord));
    EXPECT_TRUE(scene.set(look, x3d::Appearance::material, material));
    seal();
    const int before = meshes.made;
    EXPECT_TRUE(scene.set(coord, x3d::Coordinate::point, Array<Vec3f>{{1, 2, 3}}));
    {
        const InstanceDelta& delta = seal();
        ASSERT_EQ(delta.geometries.size(), 1u);
        EXPECT_EQ(delta.geometries[0].node, faces);
        EXPECT_TRUE(delta.appearanceChanged.empty());
        EXPECT_EQ(meshes.made, before + 1);
    }
    EXPECT_TRUE(scene.set(material, x3d::Material::transparency, .5f));
    EXPECT_EQ(seal().appearanceChanged, std::vector<NodeId>{look});
    const NodeId acoustics = scene.createNode(x3d::AcousticProperties::type);
    EXPECT_TRUE(scene.set(look, x3d::Appearance::acousticProperties, acoustics));
    EXPECT_TRUE(
        scene.set(scene.node(other).get(x3d::Shape::appearance), x3d::Appearance::acousticProperties, acoustics));
    EXPECT_EQ(seal().rebound.size(), 2u);
    EXPECT_TRUE(scene.set(acoustics, x3d::AcousticProperties::absorption, .25f));
    {
        const InstanceDelta& delta = seal();
        EXPECT_EQ(delta.acousticsChanged, std::vector<NodeId>{acoustics});
        EXPECT_TRUE(delta.rebound.empty());
    }
    EXPECT_TRUE(scene.set(light, x3d::PointLight::intensity, .5f));
    EXPECT_EQ(seal().placedChanged, std::vector<NodeId>{light});
}

TEST_F(FlattenerCase, PrototypeShowsItsFirstNodeAndStandsForParts) {
    const auto makeProto = [&](const char* name) {
        auto type = std::make_shared<NodeType>();
        type->name = name;
        type->kind = NodeType::Kind::proto;
        type->implements = {"X3DChildNode", "X3DNode", "X3DPrototypeInstance", "X3DGeometryNode"};
        FieldDef body;
        body.name = "body";
        body.type = FieldType::MFNode;
        body.access = Access::inputOutput;
        body.aspect = Aspect::structure;
        body.hidden = true;
        body.defaultValue = Value::zero(FieldType::MFNode);
        type->fields.push_back(body);
        EXPECT_TRUE(type->finish());
        return *scene.defineType(type);
    };
    const TypeIndex type = makeProto("Pair");
    const NodeId pair = add(x3d::Group::type, scene.root());
    const NodeId proto = scene.createNode(type);
    EXPECT_TRUE(scene.insertChild(pair, x3d::Group::children.index, proto));
    const FieldIndex body = scene.node(proto).type().findExact("body");
    const NodeId first = scene.createNode(x3d::Shape::type), second = scene.createNode(x3d::Shape::type);
    EXPECT_TRUE(scene.setField(proto, body, Array<NodeId>{first, second}));
    {
        const InstanceDelta& delta = seal();
        ASSERT_EQ(delta.added.size(), 1u);
        EXPECT_EQ(delta.added[0].shape, first);
        EXPECT_EQ(flat.flattener().path(delta.added[0].id), (std::vector<NodeId>{pair, proto, first}));
    }
    // As a geometry: the shape refers to what the instance stands for, also when that changes.
    const NodeId geometry = scene.createNode(type), box = scene.createNode(x3d::Box::type),
                 cone = scene.createNode(x3d::Cone::type);
    EXPECT_TRUE(scene.setField(geometry, body, Array<NodeId>{box}));
    ASSERT_TRUE(scene.setField(first, x3d::Shape::geometry.index, geometry));
    {
        const InstanceDelta& delta = seal();
        ASSERT_EQ(delta.rebound.size(), 1u);
        EXPECT_EQ(delta.rebound[0].geometry, box);
    }
    EXPECT_TRUE(scene.setField(geometry, body, Array<NodeId>{cone}));
    {
        const InstanceDelta& delta = seal();
        ASSERT_EQ(delta.rebound.size(), 1u);
        EXPECT_EQ(delta.rebound[0].geometry, cone);
        EXPECT_EQ(delta.geometriesRemoved, std::vector<NodeId>{box});
    }
}

TEST_F(FlattenerCase, LevelOfDetailFollowsTheViewer) {
    const NodeId lod = add(x3d::LOD::type, add(x3d::Transform::type, scene.root()));
    NodeId levels[3];
    for (NodeId& level : levels) level = addShape(lod);
    EXPECT_TRUE(scene.setField(lod, x3d::LOD::range.index, Array<float>{10, 20}));
    seal();
    const auto shown = [&] {
        NodeId seen, heard;
        for (const auto& [slot, instance] : watcher.follower.instances) {
            if (instance.seen) {
                EXPECT_FALSE(std::exchange(seen, instance.shape));
            }
            if (instance.heard) {
                EXPECT_FALSE(std::exchange(heard, instance.shape));
            }
        }
        EXPECT_EQ(heard, levels[0]) << "whatever is seen";
        return seen;
    };
    EXPECT_EQ(shown(), levels[0]);
    const NodeId expected[] = {levels[0], levels[1], levels[2], levels[1]};
    const double distances[] = {5, 15, 50, 10};
    for (int i = 0; i < 4; ++i) {
        ASSERT_TRUE(flat.setViewer(Vec3d(0, 0, distances[i])));
        EXPECT_EQ(shown(), expected[i]) << distances[i];
    }
    // The node moves instead of the viewer.
    const NodeId transform = scene.parents(lod)[0].node;
    EXPECT_TRUE(scene.set(transform, x3d::Transform::translation, Vec3f(0, 0, 9)));
    seal();
    EXPECT_EQ(shown(), levels[0]);
}

// The z axis of what hangs below points to the eye, as far as the axis lets it.
TEST_F(FlattenerCase, BillboardsTurnToTheViewer) {
    const NodeId place = add(x3d::Transform::type, scene.root()), board = add(x3d::Billboard::type, place);
    addShape(board);
    EXPECT_TRUE(scene.set(place, x3d::Transform::translation, Vec3f(3, 0, 0)));
    seal();
    const auto placed = [&] { return watcher.follower.instances.begin()->second.worldFromLocal; };
    EXPECT_EQ(placed()[2], Vec3d(0, 0, 1)) << "nobody looks";
    EXPECT_FALSE(watcher.follower.instances.begin()->second.heard);
    ASSERT_TRUE(flat.setViewer(Vec3d(3 + 5, 7, 0)));
    EXPECT_NEAR(glm::distance(placed()[2], Vec3d(1, 0, 0)), 0, 1e-12);
    EXPECT_NEAR(glm::distance(placed()[1], Vec3d(0, 1, 0)), 0, 1e-12);
    EXPECT_EQ(placed()[3], Vec3d(3, 0, 0));
    // The place moves instead of the viewer; it leans, and the axis leans with it.
    EXPECT_TRUE(scene.set(place, x3d::Transform::translation, Vec3f(8, 0, -4)));
    EXPECT_TRUE(scene.set(place, x3d::Transform::rotation, Rotation{1, 0, 0, 1.5707964f}));
    seal();
    EXPECT_NEAR(glm::distance(placed()[1], Vec3d(0, 0, 1)), 0, 1e-6);
    EXPECT_NEAR(glm::distance(placed()[2], Vec3d(0, 1, 0)), 0, 1e-6);
    // All axes: straight to the eye.
    EXPECT_TRUE(scene.set(board, x3d::Billboard::axisOfRotation, Vec3f(0)));
    seal();
    EXPECT_NEAR(glm::distance(placed()[2], glm::normalize(Vec3d(0, 7, 4))), 0, 1e-6);
    EXPECT_NEAR(placed()[0].y, 0, 1e-6) << "upright";
    EXPECT_GT(placed()[1].y, 0);
    ASSERT_TRUE(flat.setViewer(std::nullopt));
    EXPECT_NEAR(glm::distance(placed()[1], Vec3d(0, 0, 1)), 0, 1e-6);
}

TEST_F(FlattenerCase, ALevelThatIsOnlyHeardHasItsLevelsHeard) {
    const NodeId outer = add(x3d::LOD::type, scene.root()), group = add(x3d::Group::type, outer);
    const NodeId inner = add(x3d::LOD::type, group);
    const NodeId first = addShape(inner), second = addShape(inner), far = addShape(outer);
    EXPECT_TRUE(scene.setField(outer, x3d::LOD::range.index, Array<float>{10}));
    EXPECT_TRUE(scene.setField(inner, x3d::LOD::range.index, Array<float>{4}));
    seal();
    const auto shown = [&](double distance) {
        const Vec3d eye(0, 0, distance);
        EXPECT_TRUE(flat.setViewer(eye));
        expectSame(scene, flat.flattener(), watcher.follower, eye);
        std::map<NodeId, std::pair<bool, bool>> senses;
        for (const auto& [slot, i] : watcher.follower.instances) senses[i.shape] = {i.seen, i.heard};
        return senses;
    };
    using Senses = std::map<NodeId, std::pair<bool, bool>>;  // seen, heard
    for (int round = 0; round < 2; ++round) {
        EXPECT_EQ(shown(1), (Senses{{first, {true, true}}}));
        EXPECT_EQ(shown(6), (Senses{{first, {false, true}}, {second, {true, false}}}));
        EXPECT_EQ(shown(50), (Senses{{first, {false, true}}, {far, {true, false}}}));
        EXPECT_EQ(shown(6), (Senses{{first, {false, true}}, {second, {true, false}}}));
    }
}

TEST_F(FlattenerCase, LevelsInLevelsOfAnyDepth) {
    // Each LOD's further level is the next LOD; all are too far away, so the last shape is seen and the first one
    // heard.
    NodeId lod = add(x3d::LOD::type, scene.root());
    NodeId nearest, last;
    for (int i = 0; i < 20'000; ++i) {
        EXPECT_TRUE(scene.setField(lod, x3d::LOD::range.index, Array<float>{10}));
        last = addShape(lod);
        if (i == 0) nearest = last;
        if (i < 19'999) lod = add(x3d::LOD::type, lod);
    }
    seal();
    const auto expectShown = [&](NodeId seen) {
        std::size_t others = 0;
        for (const auto& [slot, instance] : watcher.follower.instances) {
            EXPECT_EQ(instance.heard, instance.shape == nearest);
            EXPECT_EQ(instance.seen, instance.shape == seen);
            others += !instance.heard && !instance.seen;
        }
        EXPECT_EQ(others, 0u);
    };
    expectShown(nearest);
    ASSERT_TRUE(flat.setViewer(Vec3d(0, 0, 50)));
    expectShown(last);
    ASSERT_TRUE(flat.setViewer(Vec3d(0, 0, 5)));
    expectShown(nearest);
}

TEST_F(FlattenerCase, NestingOfAnyDepthAndManyParents) {
    NodeId parent = scene.root();
    for (int i = 0; i < 10000; ++i) {
        const NodeId t = scene.createNode(x3d::Transform::type);
        EXPECT_TRUE(scene.set(t, x3d::Transform::translation, Vec3f(1, 0, 0)));
        EXPECT_TRUE(scene.insertChild(parent, scene.node(parent).type().findExact("children"), t));
        parent = t;
    }
    addShape(parent);
    const NodeId top = seal().added.empty() ? NodeId{} : flat.flattener().path(watcher.last.added[0].id)[0];
    ASSERT_EQ(watcher.last.added.size(), 1u);
    EXPECT_EQ(watcher.last.added[0].worldFromLocal[3].x, 10000);
    EXPECT_EQ(flat.flattener().path(watcher.last.added[0].id).size(), 10001u);
    EXPECT_TRUE(scene.set(top, x3d::Transform::translation, Vec3f(5, 0, 0)));
    ASSERT_EQ(seal().moved.size(), 1u);
    EXPECT_EQ(watcher.last.moved[0].worldFromLocal[3].x, 10004);

    const NodeId shared = addShape(scene.root());
    std::vector<NodeId> groups;
    for (int i = 0; i < 100000; ++i) {
        groups.push_back(scene.createNode(x3d::Group::type));
        ASSERT_TRUE(scene.insertChild(groups.back(), x3d::Group::children.index, shared));
        ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children.index, groups.back()));
    }
    EXPECT_EQ(seal().added.size(), 100001u);
    EXPECT_TRUE(scene.setField(shared, x3d::Shape::castShadow.index, false));
    EXPECT_EQ(seal().rebound.size(), 100001u);
    for (int i = 0; i < 100000; i += 2)
        ASSERT_TRUE(scene.removeChild(groups[static_cast<std::size_t>(i)], x3d::Group::children.index, 0));
    EXPECT_EQ(seal().removed.size(), 50000u);
    EXPECT_TRUE(scene.removeChild(scene.root(), x3d::RtsgScene::children.index, 0));
    EXPECT_EQ(seal().removed.size(), 1u);
}

TEST_F(FlattenerCase, ExponentialSharingIsCutOffWithADiagnostic) {
    Flattener::Options options;
    options.maxOccurrences = 10000;
    Flattener small(options);
    NodeId below = scene.createNode(x3d::Shape::type);
    for (int i = 0; i < 40; ++i) {
        const NodeId group = scene.createNode(x3d::Group::type);
        EXPECT_TRUE(scene.setField(group, x3d::Group::children.index, Array<NodeId>{below, below}));
        below = group;
    }
    world.reset();
    EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children.index, below));
    scene.seal();
    small.apply(scene, scene.snapshot());
    EXPECT_LE(small.instanceCount(), 10000u);
    EXPECT_GT(small.instanceCount(), 1000u);
    EXPECT_EQ(small.diagnostics().errors(), 1u);
}

TEST(InstanceDelta, DeterminantSigns) {
    const auto scaled = [](double x, double y, double z) {
        WorldFromLocal m(1.0);
        m[0].x = x, m[1].y = y, m[2].z = z;
        return m;
    };
    EXPECT_EQ(determinantSign(scaled(1, 2, 3)), 1);
    EXPECT_EQ(determinantSign(scaled(-1, 2, 3)), -1);
    EXPECT_EQ(determinantSign(scaled(1, 0, 3)), 0);
    EXPECT_EQ(determinantSign(scaled(1e-9, 1e-9, 1e-9)), 1) << "small is not singular";
    EXPECT_EQ(determinantSign(scaled(std::nan(""), 1, 1)), 0);
    EXPECT_EQ(determinantSign(scaled(HUGE_VAL, 1, 1)), 0);
}

}  // namespace
}  // namespace rtsg
