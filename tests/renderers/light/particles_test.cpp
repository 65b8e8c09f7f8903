// Particle systems in pictures: seen by both integrators, picked, in the full traversal, turned to the eye, at no cost
// while they rest; and the same picture from a replica, a late joiner and a seek.
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/picking.h>

#include "light_scene.h"
#include "world/full_traversal.h"

namespace rtsg {
namespace {

using namespace test;

/// One particle that stays where it is, white.
std::string one(const char* type, const char* more = "", const char* size = "2 1") {
    return fmt::format(
        "DEF P ParticleSystem {{ geometryType \"{}\" maxParticles 1 particleLifetime 1000 particleSize {} emitter "
        "DEF E ExplosionEmitter {{ }} appearance Appearance {{ {} pointProperties PointProperties {{ "
        "pointSizeScaleFactor 20 }} lineProperties LineProperties {{ linewidthScaleFactor 10 }} }} {} }}",
        type, size, unlit("1 1 1"), more);
}
/// Metres squared of a picture 4 m wide and high.
double whiteArea(const Picture& p) {
    double sum = 0;
    for (const Vec4f& pixel : p.pixels) sum += pixel.g;
    return sum * 16 / (double(p.width) * p.height);
}
const std::string kFlatEye = "OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] } ";

struct Sharp : LightScene {
    explicit Sharp(const std::string& body, Integrator integrator = Integrator::whitted) : LightScene(body, 100, 100) {
        options.settings.samplesPerPixel = 16;
        options.settings.integrator = integrator;
    }
};

TEST(ParticlesInPictures, CoverTheirSizeInBothIntegrators) {
    const double pixel = .04;
    for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
        const auto area = [&](const char* type, const char* more = "") {
            return whiteArea(Sharp(kFlatEye + one(type, more), integrator).picture());
        };
        EXPECT_NEAR(area("QUAD"), 2, .02);
        EXPECT_NEAR(area("SPRITE"), 2, .02);
        EXPECT_NEAR(area("TRIANGLE"), 1, .02);
        EXPECT_NEAR(area("GEOMETRY", "geometry Box { size 1 .5 9 }"), .5, .02);
        EXPECT_NEAR(area("POINT"), 400 * pixel * pixel, .001);
        EXPECT_NEAR(area("LINE"), 1 * 10 * pixel + kPi * 25 * pixel * pixel, .03) << "with round ends";
    }
}

TEST(ParticlesInPictures, SpritesTurnToTheEye) {
    const auto seen = [](const char* type, const char* transform) {
        Sharp s(
            "OrthoViewpoint { position 10 0 0 orientation 0 1 0 1.5707963 fieldOfView [ -2 -2 2 2 ] } Transform { " +
            std::string(transform) + " children " + one(type) + " }");
        return whiteArea(s.picture());
    };
    EXPECT_NEAR(seen("QUAD", ""), 0, .02) << "seen from its edge";
    EXPECT_NEAR(seen("SPRITE", ""), 2, .02);
    EXPECT_NEAR(seen("SPRITE", "rotation 0 1 0 2 scale 1 .5 1"), 1, .02);
    // One that rests turns with the eye, and when it is moved.
    Sharp s("OrthoViewpoint { fieldOfView [ -2 -2 2 2 ] } DEF T Transform { children " + one("SPRITE") + " }");
    EXPECT_NEAR(whiteArea(s.picture()), 2, .02);
    ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::rotation, Rotation{0, 1, 0, 1.2f}));
    EXPECT_NEAR(whiteArea(s.picture()), 2, .02);
}

// Law 2: of several places sprites face the eye for one of them, and it is the same one however the scene came about.
TEST(ParticlesInPictures, SpritesOfSeveralPlacesAreAsIfBuiltAnew) {
    LightScene s("DEF A Transform { translation 3 0 0 children DEF S Switch { whichChoice 0 children " + one("SPRITE") +
                 " } } DEF B Transform { rotation 0 1 0 1 translation -4 0 0 }");
    const auto meshOf = [&](const Flattener& flattener) -> std::shared_ptr<const Mesh> {
        const InstanceDelta all = flattener.snapshot();
        for (const InstanceDelta::Geometry& geometry : all.geometries)
            if (geometry.node == s.node("P")) return geometry.mesh;
        return nullptr;
    };
    const auto step = [&](int i) {
        switch (i % 7) {
            case 0:
                return s.scene.insertChild(s.node("B"), x3d::Transform::children, s.node("P"));
            case 1:
                return s.scene.set(s.node("A"), x3d::Transform::translation, Vec3f(float(i), 1, 0));
            case 2:
                return s.scene.set(s.node("S"), x3d::Switch::whichChoice, -1);
            case 3:
                return s.scene.set(s.node("B"), x3d::Transform::rotation, Rotation{0, 1, 0, .1f * float(i)});
            case 4:
                return s.scene.set(s.node("S"), x3d::Switch::whichChoice, 0);
            case 5:
                return s.scene.removeChild(s.node("B"), x3d::Transform::children.index, 0);
            default:
                return s.scene.set(s.node("P"), x3d::ParticleSystem::visible, i % 2 == 0);
        }
    };
    int compared = 0;
    for (int i = 0; i < 42; ++i) {
        ASSERT_TRUE(step(i));
        s.scene.newFrame(i);
        const Vec3d eye(.5 * i, 2, 9);
        ASSERT_TRUE(s.world->setViewer(eye));
        Flattener anew;
        anew.setViewer(eye);
        (void)anew.apply(s.scene, s.scene.snapshot());
        const auto followed = meshOf(s.world->flattener()), built = meshOf(anew);
        ASSERT_EQ(bool(followed), bool(built)) << i;
        if (!followed) continue;
        EXPECT_TRUE(followed->positions == built->positions) << i;
        ++compared;
    }
    EXPECT_GT(compared, 15);
}

TEST(ParticlesInPictures, ArePicked) {
    LightScene s("Transform { translation 0 0 1 children " + one("QUAD") + " }");
    const Picker picker(s.world->rays(), s.world->flattener());
    const auto hit = picker.ray({0, .1, 5}, {0, 0, -1});
    ASSERT_TRUE(hit && *hit);
    EXPECT_NEAR(hit->distance, 4, 1e-6);
    EXPECT_EQ(hit->path.back(), s.node("P"));
}

/// A fountain of all that there is.
const std::string kFountain =
    "DEF P ParticleSystem { geometryType \"POINT\" maxParticles 300 particleLifetime 2 emitter DEF E ConeEmitter { "
    "speed 5 surfaceArea .1 } colorKey [ 0 2 ] color Color { color [ 1 0 0, 0 0 1 ] } physics [ DEF F "
    "ForcePhysicsModel { } WindPhysicsModel { speed 2 gustiness .5 turbulence .3 } BoundedPhysicsModel { geometry "
    "Rectangle2D { size 30 30 } } ] appearance Appearance { pointProperties PointProperties { pointSizeScaleFactor 3 } "
    "} } Transform { translation 1 0 0 children ParticleSystem { maxParticles 50 emitter SurfaceEmitter { surface "
    "Sphere "
    "{ radius .5 } speed 1 } } }";

TEST(ParticlesInPictures, TheFullTraversalHasThemToo) {
    LightScene s(kFountain);
    FullTraversalRenderer full;
    ASSERT_TRUE(full.attachToScene(s.scene));
    for (int i = 1; i <= 20; ++i) {
        s.scene.newFrame(.1 * i);
        ASSERT_TRUE(full.renderFrame());
        const auto a = s.world->rays().stats(), b = full.world().stats();
        EXPECT_EQ(a.instances, b.instances);
        EXPECT_EQ(a.uniqueTriangles, b.uniqueTriangles) << i;
        EXPECT_GT(a.uniqueTriangles, 0u);
    }
}

// Resting particles are not made again.
TEST(ParticlesInPictures, CostNothingWhileTheyRest) {
    struct Watcher final : InstanceSubscriber {
        std::size_t geometries = 0;
        Result<> apply(const Scene&, const ChangeSet&, const InstanceDelta& delta) override {
            geometries += delta.geometries.size();
            return {};
        }
    } watcher;
    LightScene s(kFountain + " DEF C Transform { }");
    s.world->add(watcher);
    s.scene.newFrame(1);
    const std::size_t before = watcher.geometries;
    s.scene.newFrame(1);
    ASSERT_TRUE(s.scene.set(s.node("C"), x3d::Transform::translation, Vec3f(1)));
    s.scene.newFrame(1);
    EXPECT_EQ(watcher.geometries, before) << "time stands";
    ASSERT_TRUE(s.scene.set(s.node("P"), x3d::ParticleSystem::enabled, false));
    s.scene.newFrame(2);
    const std::size_t once = watcher.geometries;
    EXPECT_EQ(once, before + 2) << "the one that is off, and the other";
    for (int i = 3; i < 9; ++i) s.scene.newFrame(i);
    EXPECT_EQ(watcher.geometries, once + 6) << "of the one that goes on alone";
}

TEST(ParticlesInPictures, AReplicaALateJoinerAndASeekSeeTheSame) {
    LightScene origin(kFountain + " Viewpoint { position 0 1 8 }", 60, 60);
    struct Follower final : Subscriber {
        Scene replica;
        Follower() { replica.setBehavioursEnabled(false); }
        Result<> apply(const Scene&, const ChangeSet& changes) override {
            return replica.apply(std::make_shared<const ChangeSet>(changes));
        }
    } early, late;
    std::vector<Attachment> attached;
    attached.push_back(origin.scene.bus().attach(early));
    const NodeId e = origin.node("E");
    for (int i = 1; i <= 90; ++i) {
        // The emitter moves and its force changes: what lives now was born in many ways.
        ASSERT_TRUE(origin.scene.set(e, x3d::ConeEmitter::position, Vec3f(.02f * float(i), 0, 0)));
        if (i == 50) {
            ASSERT_TRUE(origin.scene.set(origin.node("F"), x3d::ForcePhysicsModel::force, Vec3f(1, -5, 0)));
        }
        if (i == 60 || i == 75) {
            ASSERT_TRUE(origin.scene.set(e, x3d::ConeEmitter::on, i == 75));
        }
        if (i == 85) attached.push_back(origin.scene.bus().attach(late));
        origin.scene.newFrame(i / 30.0);
    }
    const Picture first = origin.picture();
    double red = 0;
    for (const Vec4f& p : first.pixels) red += p.r;
    EXPECT_GT(red, 1);
    for (Follower* follower : {&early, &late}) {
        EXPECT_EQ(follower->replica.hash(), origin.scene.hash());
        SharedWorld world(follower->replica);
        LightRenderer light(world);
        const auto picture = light.picture(origin.options);
        ASSERT_TRUE(picture);
        EXPECT_EQ(picture->pixels, first.pixels);
    }
}

}  // namespace
}  // namespace rtsg
