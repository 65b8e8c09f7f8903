// Where particles are, in double precision against closed forms: flight, emitters, wind, walls; and how they are drawn.
#include "tessellate/particles.h"

#include <functional>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/tessellator.h>

#include "mesh_check.h"

namespace rtsg {
namespace {

using detail::MovedParticle;

/// A scene with a ParticleSystem P, whose fields are `text`.
struct Swarm {
    Scene scene;
    Diagnostics diagnostics;
    Mesh problems;
    NodeId id;

    explicit Swarm(const std::string& text) {
        EXPECT_TRUE(
            loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\nDEF P ParticleSystem { " + text + " }", diagnostics));
        EXPECT_EQ(diagnostics.errors(), 0u) << (diagnostics.all().empty() ? "" : diagnostics.all()[0].format());
        id = scene.findName("P");
        scene.newFrame(1000);
    }
    /// `since` the first frame.
    std::vector<MovedParticle> at(double since) {
        scene.newFrame(1000 + since);
        return now();
    }
    std::vector<MovedParticle> now() {
        const detail::MeshOf meshOf = [&](NodeId node) -> std::shared_ptr<const Mesh> {
            const auto created = tessellate(scene, node);
            return created ? *created : nullptr;
        };
        return detail::moveParticles(scene, scene.node(id), meshOf, problems);
    }
    Mesh mesh() {
        auto created = tessellate(scene, id);
        EXPECT_TRUE(created);
        EXPECT_EQ(findDefect(**created), "");
        return **created;
    }
};

void expectAt(const Vec3d& seen, const Vec3d& expected, double tolerance, double age) {
    EXPECT_LE(glm::length(seen - expected), tolerance)
        << "age " << age << ": " << seen.x << " " << seen.y << " " << seen.z << ", not " << expected.x << " "
        << expected.y << " " << expected.z;
}
/// Each of `bins` equal parts of 0 ... 1 has its share, within one in ten thousand.
void expectEven(const std::vector<double>& fractions, std::size_t bins) {
    std::vector<double> counts(bins);
    for (const double s : fractions) {
        ASSERT_GE(s, -1e-9);
        ASSERT_LE(s, 1 + 1e-9);
        ++counts[std::min(bins - 1, static_cast<std::size_t>(std::max(0.0, s) * double(bins)))];
    }
    double chi = 0;
    const double each = double(fractions.size()) / double(bins);
    for (const double n : counts) chi += (n - each) * (n - each) / each;
    const double k = double(bins) - 1;
    EXPECT_LT(chi, k + 4 * std::sqrt(2 * k) + 8) << "chi square of " << k << " degrees of freedom";
}
const std::string kMany = "maxParticles 20000 particleLifetime 10 lifetimeVariation 0 ";

TEST(ParticlesInFlight, FollowTheParabola) {
    Swarm s(
        "emitter PointEmitter { position 1 2 3 direction 2 2 1 speed 6 variation 0 mass 4 } particleLifetime 3 "
        "physics [ ForcePhysicsModel { force 0 -20 4 } ForcePhysicsModel { force 8 0 0 } ForcePhysicsModel { force 9 9 "
        "9 enabled FALSE } ]");
    const Vec3d v = Vec3d(2, 2, 1) * 2.0, a(2, -5, 1);
    for (const double t : {0.0, .3, 1.0, 2.9, 7.77, 60.0}) {
        const auto particles = s.at(t);
        EXPECT_GT(particles.size(), 0u);
        EXPECT_EQ(particles.size() == 200, t >= 3);
        for (const MovedParticle& p : particles) {
            expectAt(p.position, Vec3d(1, 2, 3) + v * p.age + a * (.5 * p.age * p.age), 1e-12 * (1 + p.age), p.age);
            expectAt(p.velocity, v + a * p.age, 1e-12 * (1 + p.age), p.age);
        }
    }
    Swarm massless("emitter PointEmitter { } physics ForcePhysicsModel { }");
    for (const MovedParticle& p : massless.at(4))
        expectAt(p.position, Vec3d(0, double(-9.8f) * .5 * p.age * p.age, 0), 1e-9, p.age);
}

TEST(ParticlesInFlight, ExplosionsGoToAllSides) {
    Swarm s(kMany + "emitter ExplosionEmitter { speed 4 variation .5 position 1 0 0 }");
    const auto particles = s.at(2);
    ASSERT_EQ(particles.size(), 20'000u);
    std::vector<double> heights, rotations, speeds;
    for (const MovedParticle& p : particles) {
        EXPECT_EQ(p.age, 2);
        expectAt(p.position, Vec3d(1, 0, 0) + p.velocity * 2.0, 1e-12, 2);
        const double speed = glm::length(p.velocity);
        heights.push_back(.5 + .5 * p.velocity.y / speed);
        rotations.push_back(.5 + std::atan2(p.velocity.x, p.velocity.z) / (2 * kPiOfMesh));
        speeds.push_back((speed - 2) / 4);
    }
    for (const auto& fractions : {heights, rotations, speeds}) expectEven(fractions, 20);
    EXPECT_EQ(s.at(9.99).size(), 20'000u);
    EXPECT_EQ(s.at(10).size(), 0u);
    EXPECT_EQ(s.at(30).size(), 0u);
}

TEST(ParticlesInFlight, ConesAreEvenlyFilled) {
    Swarm s(kMany + "emitter ConeEmitter { direction 1 1 0 angle .6 speed 1 variation 0 }");
    std::vector<double> caps, rotations;
    const Vec3d axis = glm::normalize(Vec3d(1, 1, 0)), side = glm::normalize(Vec3d(1, -1, 0));
    for (const MovedParticle& p : s.at(20)) {
        EXPECT_NEAR(glm::length(p.velocity), 1, 1e-12);
        caps.push_back((1 - glm::dot(p.velocity, axis)) / (1 - std::cos(double(.6f))));
        rotations.push_back(.5 + std::atan2(glm::dot(p.velocity, side), p.velocity.z) / (2 * kPiOfMesh));
    }
    EXPECT_EQ(caps.size(), 20'000u);
    expectEven(caps, 20);
    expectEven(rotations, 20);
}

TEST(ParticlesInFlight, LinesAreEvenlyFilledByLength) {
    Swarm s(kMany +
            "emitter PolylineEmitter { direction 0 0 2 speed 1 variation 0 coordIndex [ 0 1 2 -1 3 4 9 4 ] "
            "coord Coordinate { point [ 0 0 0, 1 0 0, 1 3 0, 5 0 0, 5 6 0 ] } }");
    std::vector<double> distances;
    for (const MovedParticle& p : s.at(20)) {
        const Vec3d from = p.position - Vec3d(0, 0, p.age);
        EXPECT_NEAR(from.z, 0, 1e-9);
        if (from.y == 0 && from.x < 1)
            distances.push_back(from.x / 10);
        else if (std::abs(from.x - 1) < 1e-9)
            distances.push_back((1 + from.y) / 10);
        else if (std::abs(from.x - 5) < 1e-9)
            distances.push_back((4 + from.y) / 10);
        else
            ADD_FAILURE() << from.x << " " << from.y;
    }
    expectEven(distances, 20);
    Swarm none("emitter PolylineEmitter { }");
    EXPECT_TRUE(none.at(1).empty());
    EXPECT_EQ(none.problems.diagnostics.warnings(), 1u);
}

TEST(ParticlesInFlight, SurfacesAreEvenlyFilledByArea) {
    Swarm s(kMany + "emitter SurfaceEmitter { speed 1 variation 0 surface Box { size 2 4 8 } }");
    std::vector<double> counts(3), alongZ;
    for (const MovedParticle& p : s.at(20)) {
        const Vec3d from = p.position - p.velocity * p.age;
        int axis = 0;
        for (int i = 0; i < 3; ++i)
            if (std::abs(p.velocity[i]) > .5) axis = i;
        const double half = 1 << axis;
        EXPECT_NEAR(p.velocity[axis], from[axis] > 0 ? 1 : -1, 1e-6) << "outwards";
        EXPECT_NEAR(std::abs(from[axis]), half, 1e-6);
        ++counts[static_cast<std::size_t>(axis)];
        if (axis == 0) alongZ.push_back(.5 + from.z / 8);
    }
    expectEven(alongZ, 16);
    EXPECT_NEAR(counts[0], 20'000 * 32 / 56.0, 300);
    EXPECT_NEAR(counts[1], 20'000 * 16 / 56.0, 300);
    EXPECT_NEAR(counts[2], 20'000 * 8 / 56.0, 250);
    Swarm sides(kMany + "emitter SurfaceEmitter { speed 1 surface Rectangle2D { solid FALSE } }");
    double front = 0;
    for (const MovedParticle& p : sides.at(20)) front += p.velocity.z > 0;
    EXPECT_NEAR(front, 10'000, 300) << "one with two sides emits from both";
    Swarm none("emitter SurfaceEmitter { }");
    EXPECT_TRUE(none.at(1).empty());
    EXPECT_EQ(none.problems.diagnostics.warnings(), 1u);
}

// An L of three unit cubes.
const std::string kL =
    "coordIndex [ 0 1 2 3 4 5 -1 11 10 9 8 7 6 -1 0 6 7 1 -1 1 7 8 2 -1 2 8 9 3 -1 3 9 10 4 -1 4 10 11 5 -1 5 11 6 0 "
    "-1 ] coord Coordinate { point [ 0 0 0, 0 2 0, 1 2 0, 1 1 0, 2 1 0, 2 0 0, 0 0 1, 0 2 1, 1 2 1, 1 1 1, 2 1 1, 2 0 "
    "1 ] }";

TEST(ParticlesInFlight, VolumesAreEvenlyFilled) {
    Swarm s(kMany + "emitter VolumeEmitter { " + kL + " }");
    std::vector<double> depths, counts(3);
    for (const MovedParticle& p : s.at(20)) {
        const Vec3d at = p.position;
        EXPECT_FALSE(at.x > 1 && at.y > 1);
        ++counts[at.x > 1 ? 1 : at.y > 1 ? 2 : 0];
        depths.push_back(at.z);
    }
    expectEven(depths, 20);
    for (const double count : counts) EXPECT_NEAR(count, 20'000 / 3.0, 300);
    Swarm skin(kMany + "emitter VolumeEmitter { internal FALSE " + kL + " }");
    double flat = 0;
    for (const MovedParticle& p : skin.at(20)) flat += p.position.z == 0 || p.position.z == 1;
    EXPECT_NEAR(flat, 20'000 * 6 / 14.0, 330);
}

// 40.4.9: pressure = 10^(2 log10(speed)) * 0.64615.
TEST(ParticlesInFlight, WindPushesByItsPressure) {
    Swarm s(
        "emitter PointEmitter { surfaceArea .5 mass 2 } physics [ WindPhysicsModel { direction 0 0 -3 speed 8 "
        "gustiness "
        "0 } ForcePhysicsModel { force 0 2 0 } ]");
    const double a = std::pow(10, 2 * std::log10(8)) * .64615 * .5 / 2;
    for (const MovedParticle& p : s.at(4)) {
        expectAt(p.position, Vec3d(0, .5 * p.age * p.age, -.5 * a * p.age * p.age), 1e-9, p.age);
        expectAt(p.velocity, Vec3d(0, p.age, -a * p.age), 1e-9, p.age);
    }
}

// The acceleration is that of one speed a tenth of a second long, and the same for all; speed and place are its
// integrals, here summed up from differences.
TEST(ParticlesInFlight, GustsAreTheSameForAll) {
    Swarm s(
        "maxParticles 20 emitter ExplosionEmitter { surfaceArea 1 } particleLifetime 90 lifetimeVariation 0 physics "
        "WindPhysicsModel { speed 1 gustiness .8 }");
    Swarm later(
        "createParticles FALSE emitter ExplosionEmitter { surfaceArea 1 } particleLifetime 90 physics DEF W "
        "WindPhysicsModel { speed 1 gustiness .8 }");
    double speed = 0, distance = 0, sum = 0, minimum = 9, maximum = 0;
    const double tick = .1, unit = .64615;
    for (int i = 1; i <= 800; ++i) {
        const auto particles = s.at(i * tick);
        ASSERT_EQ(particles.size(), 20u);
        const double now = particles[0].velocity.x, pressure = (now - speed) / tick / unit;
        distance += .5 * (speed + now) * tick;
        speed = now;
        sum += pressure, minimum = std::min(minimum, pressure), maximum = std::max(maximum, pressure);
        EXPECT_NEAR(particles[0].position.x, distance, 1e-8 * (1 + distance));
        EXPECT_NEAR(particles[19].position.x, distance, 1e-8 * (1 + distance));
    }
    EXPECT_GE(minimum, .04 - 1e-6);
    EXPECT_LE(maximum, 3.24 + 1e-6);
    EXPECT_LT(minimum, .1);
    EXPECT_GT(maximum, 3);
    EXPECT_NEAR(sum / 800, 1 + .64 / 3, .15) << "the mean of a square";
}

TEST(ParticlesInFlight, TurbulenceTurnsEachForItsLife) {
    Swarm s(kMany +
            "emitter ExplosionEmitter { surfaceArea 1 } physics WindPhysicsModel { gustiness 0 turbulence .25 }");
    std::vector<double> caps;
    const auto early = s.at(1), late = s.at(9);
    for (std::size_t i = 0; i < early.size(); ++i) {
        const Vec3d one = glm::normalize(early[i].velocity), other = glm::normalize(late[i].velocity);
        EXPECT_NEAR(glm::dot(one, other), 1, 1e-12);
        caps.push_back((1 - one.x) / (1 - std::cos(kPiOfMesh / 4)));
    }
    expectEven(caps, 20);
}

/// Between 0 and `size`, as what flies to and fro between two walls.
double folded(double x, double size) {
    x = std::fmod(std::fmod(x, 2 * size) + 2 * size, 2 * size);
    return x < size ? x : 2 * size - x;
}

TEST(ParticlesInBounds, FlyToAndFroInABox) {
    Swarm s(
        "maxParticles 500 particleLifetime 20 emitter ExplosionEmitter { speed 5 variation .9 position .25 .5 -.3 } "
        "physics BoundedPhysicsModel { geometry Box { size 2 4 6 } }");
    const auto first = s.at(1e-6);
    const Vec3d size(2, 4, 6), start(.25, .5, double(-.3f));
    for (const double t : {.5, 3.0, 14.5}) {
        const auto particles = s.at(t);
        ASSERT_EQ(particles.size(), 500u);
        for (std::size_t i = 0; i < particles.size(); ++i) {
            Vec3d expected;
            for (int k = 0; k < 3; ++k)
                expected[k] =
                    folded(start[k] + .5 * size[k] + first[i].velocity[k] * particles[i].age, size[k]) - .5 * size[k];
            expectAt(particles[i].position, expected, 1e-5, t);
            EXPECT_NEAR(glm::length(particles[i].velocity), glm::length(first[i].velocity), 1e-9) << "no loss";
        }
    }
}

TEST(ParticlesInBounds, BounceAsHighAsTheyFell) {
    Swarm s(
        "maxParticles 1 particleLifetime 100 lifetimeVariation 0 emitter PointEmitter { position .1 5 .2 } physics [ "
        "ForcePhysicsModel { force 0 -10 0 } BoundedPhysicsModel { geometry Rectangle2D { size 50 50 } } "
        "BoundedPhysicsModel { geometry IndexedFaceSet { coordIndex [ 0 1 2 3 ] coord Coordinate { point [ -9 0 -9, -9 "
        "0 9, 9 0 9, 9 0 -9 ] } } } ]");
    // A second down, a second up; the upright rectangle at z = 0 is never met.
    for (const double t : {.5, 1.25, 1.75, 2.0, 7.3, 61.9}) {
        const double since = t - 2 * std::round(t / 2);
        const auto particles = s.at(t);
        ASSERT_EQ(particles.size(), 1u);
        expectAt(particles[0].position, Vec3d(double(.1f), 5 - 5 * since * since, double(.2f)), 1e-5, t);
    }
}

TEST(ParticlesInBounds, NothingGetsOutThroughEdgesWhateverTheWind) {
    Swarm s(
        "maxParticles 2000 particleLifetime 6 emitter ExplosionEmitter { speed 3 surfaceArea 1 } physics [ "
        "WindPhysicsModel { speed 3 gustiness .9 turbulence .6 direction 1 1 1 } ForcePhysicsModel { force 0 -9 0 } "
        "BoundedPhysicsModel { geometry Box { size 1 1 1 } } ]");
    for (const double t : {.4, 2.0, 4.4})
        for (const MovedParticle& p : s.at(t))
            for (int k = 0; k < 3; ++k) EXPECT_LE(std::abs(p.position[k]), .5 + 1e-6) << t;
}

TEST(ParticlesInBounds, TooManyTestsAreRefusedWithAWord) {
    Swarm s(
        "maxParticles 1000000 emitter ExplosionEmitter { speed 1 variation 0 } physics BoundedPhysicsModel { geometry "
        "Sphere { radius .1 } }");
    const auto particles = s.at(1);
    EXPECT_EQ(particles.size(), 1'000'000u);
    ASSERT_EQ(s.problems.diagnostics.warnings(), 1u);
    EXPECT_NE(s.problems.diagnostics.all()[0].text.find("not bounded"), std::string::npos);
    EXPECT_NEAR(glm::length(particles[17].position), 1, 1e-9);
}

TEST(ParticlesInBounds, ThinVolumesForTooManyAreRefusedWithAWord) {
    const std::string thin =
        "emitter VolumeEmitter { coordIndex [ 0 2 1 -1 0 1 3 -1 1 2 3 -1 2 0 3 ] coord Coordinate { point [ 0 0 0, 1 1 "
        "1, 1 1.001 1, 1 1 1.001 ] } }";
    Swarm few("maxParticles 100 " + thin), many("maxParticles 1000000 " + thin);
    EXPECT_GT(few.at(1).size(), 10u);
    EXPECT_EQ(few.problems.diagnostics.warnings(), 0u);
    EXPECT_TRUE(many.at(1).empty());
    EXPECT_EQ(many.problems.diagnostics.warnings(), 1u);
}

// 40.4: what an emitter and the size are like counts for those that are born then.
TEST(ParticlesInFlight, AnEmitterThatMovesLeavesThemBehind) {
    Swarm s("maxParticles 100 particleLifetime 10 lifetimeVariation 0 emitter DEF E PointEmitter { }");
    const NodeId e = s.scene.findName("E");
    for (int i = 0; i < 200; ++i) {
        s.scene.newFrame(1000 + .05 * i);
        ASSERT_TRUE(s.scene.set(e, x3d::PointEmitter::position, Vec3f(.05f * float(i), 0, 0)));
    }
    ASSERT_TRUE(s.scene.set(s.id, x3d::ParticleSystem::particleSize, Vec2f(1, 2)));
    s.scene.newFrame(1010);
    const auto particles = s.at(12);
    ASSERT_EQ(particles.size(), 100u);
    int resized = 0;
    for (const MovedParticle& p : particles) {
        const double born = 12 - p.age;
        EXPECT_NEAR(p.position.x, std::min(born, 9.95), .11) << "where the emitter was";
        EXPECT_EQ(p.size.y == 2, born > 9.95) << born;
        resized += p.size.y == 2;
    }
    EXPECT_NEAR(resized, 20, 1);
}

// Stretches of time in which nothing was born are not kept, however often an emitter moves.
TEST(ParticlesInFlight, OnlyWhatSomethingWasBornInIsKept) {
    Swarm s("maxParticles 1 particleLifetime 100 lifetimeVariation 0 emitter DEF E PointEmitter { }");
    for (int i = 0; i < 300; ++i) {
        ASSERT_TRUE(s.scene.set(s.scene.findName("E"), x3d::PointEmitter::position, Vec3f(float(i), 0, 0)));
        EXPECT_EQ(s.at(i).size(), 1u) << i;
        EXPECT_LE(unpackEmission(s.scene.node(s.id).get(x3d::ParticleSystem::_emission).span()).size(), 3u) << i;
    }
}

// 40.4: enabled FALSE takes all away and TRUE begins as before; another explosion is another one.
TEST(ParticlesInFlight, BeginAnewAndExplodeAgain) {
    Swarm s("maxParticles 3 particleLifetime 2 emitter DEF E ExplosionEmitter { speed 1 }");
    const auto rotation = [&](const char* node, auto field, bool on, double since) {
        EXPECT_TRUE(s.scene.set(s.scene.findName(node), field, on));
        s.at(since);
    };
    const auto first = s.at(1);
    ASSERT_EQ(first.size(), 3u);
    rotation("P", x3d::ParticleSystem::enabled, false, 1.5);
    EXPECT_TRUE(s.now().empty());
    rotation("P", x3d::ParticleSystem::enabled, true, 10);
    const auto second = s.at(11);
    ASSERT_EQ(second.size(), 3u);
    expectAt(second[0].position, first[0].position, 1e-9, 1);
    EXPECT_TRUE(s.at(20).empty());
    rotation("E", x3d::ExplosionEmitter::on, false, 21);
    rotation("E", x3d::ExplosionEmitter::on, true, 22);
    const auto third = s.at(23);
    ASSERT_EQ(third.size(), 3u);
    EXPECT_GT(glm::length(third[0].position - first[0].position), 1e-3);
}

TEST(ParticlesInFlight, WhatCannotBeEmitsNothing) {
    for (const char* text : {"particleLifetime -1", "maxParticles -5", "lifetimeVariation 7", "particleSize -1 1"}) {
        Scene scene;
        Diagnostics diagnostics;
        (void)loadText(
            scene,
            std::string("#X3D V4.0 utf8\nPROFILE Full\nDEF P ParticleSystem { ") + text + " emitter PointEmitter { } }",
            diagnostics);
        scene.newFrame(0);
        scene.newFrame(1);
        const auto mesh = tessellate(scene, scene.findName("P"));
        ASSERT_TRUE(mesh) << text;
        EXPECT_TRUE((*mesh)->empty() || diagnostics.warnings() > 0) << text;
    }
}

// ---- how they are drawn ---------------------------------------------------------------------------------------------

const std::string kFew =
    "maxParticles 10 particleLifetime 8 lifetimeVariation 0 particleSize .5 .25 emitter ExplosionEmitter { speed 3 } ";

TEST(ParticlePictures, QuadsAndTrianglesLieInThePlaneOfTheSystem) {
    Swarm quads(kFew), triangles(kFew + "geometryType \"TRIANGLE\"");
    quads.at(1), triangles.at(1);
    EXPECT_NEAR(surfaceArea(quads.mesh()), 10 * .5 * .25, 1e-6);
    EXPECT_NEAR(surfaceArea(triangles.mesh()), 10 * .5 * .25 / 2, 1e-6);
    EXPECT_EQ(quads.mesh().triangleCount, 20u);
    EXPECT_NEAR(quads.mesh().geometricNormal(3).z, 1, 1e-6);
    EXPECT_FALSE(quads.mesh().solid);
    const Vec4f corner = quads.mesh().texCoord(0, 1, 0);
    EXPECT_EQ(Vec2f(corner), Vec2f(1, 0));
}

TEST(ParticlePictures, LinesLieAlongTheWayAndPointsAreAtThePlace) {
    Swarm lines(kFew + "geometryType \"LINE\""), points(kFew + "geometryType \"POINT\"");
    const auto particles = lines.at(2);
    const Mesh line = lines.mesh();
    ASSERT_EQ(line.strokes, Mesh::Strokes::lines);
    ASSERT_EQ(line.strokeCount, 10u);
    for (std::uint32_t i = 0; i < 10; ++i) {
        const Vec3d along(line.vertex(i, 1) - line.vertex(i, 0)), middle(line.vertex(i, 1) + line.vertex(i, 0));
        expectAt(along, glm::normalize(particles[i].velocity) * .25, 1e-6, 2);
        expectAt(.5 * middle, particles[i].position, 1e-5, 2);
    }
    points.at(2);
    const Mesh point = points.mesh();
    ASSERT_EQ(point.strokes, Mesh::Strokes::points);
    for (std::uint32_t i = 0; i < 10; ++i) expectAt(Vec3d(point.vertex(i, 0)), particles[i].position, 1e-5, 2);
}

TEST(ParticlePictures, SpritesFaceTheEye) {
    Swarm s(kFew + "geometryType \"SPRITE\"");
    s.at(1);
    Tessellator tessellator;
    const Vec3d eye(3, 7, -5);
    const auto mesh = tessellator.particles(s.scene, s.id, eye);
    ASSERT_TRUE(mesh);
    EXPECT_EQ(findDefect(*mesh), "");
    EXPECT_NEAR(surfaceArea(*mesh), 10 * .5 * .25, 1e-5);
    const auto particles = s.now();
    for (std::uint32_t i = 0; i < 10; ++i) {
        const Vec3d towards = glm::normalize(eye - particles[i].position);
        expectAt(Vec3d(mesh->geometricNormal(2 * i)), towards, 1e-4, 1);
        EXPECT_NEAR(mesh->vertex(2 * i, 1).y, mesh->vertex(2 * i, 0).y, 1e-5) << "upright";
    }
    EXPECT_NEAR(s.mesh().geometricNormal(0).z, 1, 1e-6) << "without an eye";
    // Straight above.
    EXPECT_NEAR(surfaceArea(*tessellator.particles(s.scene, s.id, particles[0].position + Vec3d(0, 2, 0))), 1.25, 1e-5);
}

TEST(ParticlePictures, GeometryIsCopied) {
    Swarm boxes(kFew + "geometryType \"GEOMETRY\" geometry Box { size .1 .2 .3 }");
    const auto particles = boxes.at(1);
    const Mesh mesh = boxes.mesh();
    EXPECT_NEAR(surfaceArea(mesh), 10 * .22, 1e-5);
    EXPECT_NEAR(enclosedVolume(mesh), 10 * .006, 1e-6);
    EXPECT_TRUE(mesh.solid);
    Bounds all;
    for (const MovedParticle& p : particles) {
        all.extend(Vec3f(p.position) + Vec3f(.05f, .1f, .15f));
        all.extend(Vec3f(p.position) - Vec3f(.05f, .1f, .15f));
    }
    expectAt(Vec3d(mesh.bounds.min), Vec3d(all.min), 1e-5, 1);
    expectAt(Vec3d(mesh.bounds.max), Vec3d(all.max), 1e-5, 1);
    // 40.2.1: one that is given is taken, whatever geometryType says; lines are copied, too.
    Swarm lines(kFew + "geometry LineSet { vertexCount 3 coord Coordinate { point [ 0 0 0, 1 0 0, 1 1 0 ] } }");
    lines.at(1);
    EXPECT_EQ(lines.mesh().strokeCount, 20u);
    Swarm none(kFew + "geometryType \"GEOMETRY\"");
    none.at(1);
    EXPECT_TRUE(none.mesh().empty());
    EXPECT_EQ(none.mesh().diagnostics.warnings(), 1u);
    Swarm odd(kFew + "geometryType \"STAR\"");
    odd.at(1);
    EXPECT_EQ(odd.mesh().triangleCount, 20u);
    EXPECT_EQ(odd.mesh().diagnostics.warnings(), 1u);
    Swarm heavy("maxParticles 100000 emitter ExplosionEmitter { } geometry Sphere { }");
    heavy.at(.1);
    EXPECT_LE(heavy.mesh().triangleCount, (1u << 22) / 3);
    EXPECT_EQ(heavy.mesh().diagnostics.warnings(), 1u);
}

TEST(ParticlePictures, ColoursFollowTheAge) {
    Swarm s(kFew + "colorKey [ 1 2 4 ] color Color { color [ 1 0 0, 0 1 0, 0 0 .5 ] }");
    const auto color = [&](double t) {
        s.at(t);
        return s.mesh().color(0, .3f, .3f);
    };
    const auto expect = [&](double t, float r, float g, float b) {
        const ColorRGBA c = color(t);
        EXPECT_NEAR(c.r, r, 1e-5) << t;
        EXPECT_NEAR(c.g, g, 1e-5) << t;
        EXPECT_NEAR(c.b, b, 1e-5) << t;
    };
    expect(.5, 1, 0, 0);
    expect(1.5, 1, 1, 0);  // half way in hue from red to green
    expect(2, 0, 1, 0);
    expect(3, 0, .75f, .75f);
    expect(7, 0, 0, .5f);
    Swarm fading(kFew + "colorKey [ 0 4 ] color ColorRGBA { color [ 1 1 1 1, 1 1 1 0 ] }");
    fading.at(1);
    EXPECT_NEAR(fading.mesh().color(0, 0, 0).a, .75f, 1e-6);
    Swarm plain(kFew);
    plain.at(1);
    EXPECT_FALSE(plain.mesh().colors.present());
}

TEST(ParticlePictures, TextureCoordinatesStepFromKeyToKey) {
    Swarm s(kFew +
            "texCoordKey [ 0 2 ] texCoord TextureCoordinate { point [ 0 0, .5 0, .5 1, 0 1, .5 0, 1 0, 1 1, .5 1 ] }");
    s.at(1.9);
    EXPECT_EQ(Vec2f(s.mesh().texCoord(0, 1, 0)), Vec2f(.5f, 0));
    s.at(2);
    EXPECT_EQ(Vec2f(s.mesh().texCoord(0, 1, 0)), Vec2f(1, 0));
    Swarm few(kFew + "texCoordKey [ 0 2 ] texCoord TextureCoordinate { point [ 0 0, .5 0, .5 1, 0 1 ] }");
    few.at(1);
    EXPECT_EQ(Vec2f(few.mesh().texCoord(0, 1, 0)), Vec2f(1, 0));
    EXPECT_EQ(few.mesh().diagnostics.warnings(), 1u);
}

}  // namespace
}  // namespace rtsg
