// Groups of samples that are traced together: each gets, bit for bit, what it gets alone.
#include "packet/tile_rays.h"

#include <algorithm>
#include <bit>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "light_scene.h"
#include "picture/draw.h"

namespace rtsg {
namespace {

using namespace test;
using trace::TileResult;

/// A glossy wall, a mirror and glass before it, a panel and a lamp.
std::string manyPaths() {
    return square(4, "material PhysicalMaterial { baseColor .8 .7 .6 roughness .4 }") +
           "Transform { translation 0 .5 1 children " + square(.5, mirror(".9")) + "}\n" +
           "Transform { translation -1 0 1 rotation 0 1 0 1 children " + square(.5, glass(1.5)) + "}\n" +
           "Transform { translation 0 3 3 rotation 1 0 0 1.2 children " +
           square(1, "material Material { diffuseColor 0 0 0 emissiveColor 1 1 1 }") +
           "}\nPointLight { location 1 1 4 }\n";
}

/// The same for every bit; NaN is none.
void expectSameOfTile(const std::vector<Vec3f>& a, const std::vector<Vec3f>& b) {
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i], b[i]) << i;
}

TEST(TileGroups, GetWhatEachGetsAlone) {
    LightScene s(manyPaths(), 20, 20);
    LightTracer tracer;
    s.world->add(tracer);
    const auto state = tracer.latest();
    const RayWorld& rays = s.world->rays();
    const auto camera = tracer.camera(rays, 1);
    ASSERT_TRUE(camera);
    for (const Integrator integrator : {Integrator::path, Integrator::whitted})
        for (const ColorSpace space : {ColorSpace::linear, ColorSpace::automatic}) {
            RenderSettings settings = s.options.settings;
            settings.integrator = integrator, settings.samplesPerPixel = 4, settings.colorSpace = space;
            settings.maxDepth = 2;
            trace::TraceScene scene = trace::makeTraceScene(*state, rays, *camera, settings, trace::Part());
            trace::Sources sources;
            if (integrator == Integrator::path) trace::lookForLight(scene, sources);
            std::vector<TileResult> groups(3);
            for (std::size_t i = 0; i < groups.size(); ++i) {
                groups[i].seed = 77 + i;
                groups[i].blocks = 0x5F31, groups[i].firstSample = 1, groups[i].lastSample = 3;
            }
            std::vector<TileResult> alone = groups;
            trace::traceTile(scene, *camera, settings, 0, 0, groups);
            std::uint64_t primary = 0, secondary = 0, shadow = 0;
            for (std::size_t i = 0; i < alone.size(); ++i) {
                SCOPED_TRACE(testing::Message() << static_cast<int>(integrator) << " group " << i);
                trace::traceTile(scene, *camera, settings, 0, 0, std::span(&alone[i], 1));
                for (std::size_t k = 0; k < alone[i].sum.size(); ++k) EXPECT_EQ(groups[i].sum[k], alone[i].sum[k]) << k;
                expectSameOfTile(groups[i].light, alone[i].light);
                expectSameOfTile(groups[i].weight, alone[i].weight);
                EXPECT_EQ(groups[i].missing, alone[i].missing);
                primary += alone[i].primaryRays, secondary += alone[i].secondaryRays, shadow += alone[i].shadowRays;
            }
            EXPECT_NE(alone[0].sum, alone[1].sum) << "seeds differ";
            EXPECT_EQ(groups[0].primaryRays, primary);
            EXPECT_EQ(groups[0].secondaryRays, secondary);
            EXPECT_EQ(groups[0].shadowRays, shadow);
        }
}

// Of 17 x 3 rays that surfaces side by side ask for, those that turn alike share packets, in the order in which they
// were asked for: 16 straight ones; the last of them with 15 mirrored ones; two more of those with 14 bent ones; the
// last three.
TEST(TileLoop, WhatTurnsAlikeGoesTogether) {
    LightScene s(square(1, unlit("1 1 1")), 16, 16);
    LightTracer tracer;
    s.world->add(tracer);
    const auto state = tracer.latest();
    const auto camera = tracer.camera(s.world->rays(), 1);
    ASSERT_TRUE(camera);
    const RenderSettings settings = s.options.settings;
    const trace::TraceScene scene = trace::makeTraceScene(*state, s.world->rays(), *camera, settings, trace::Part());
    std::vector<TileResult> groups(1);
    using trace::TileLoop;
    TileLoop loop(scene, *camera, settings, 0, 0, groups);
    for (std::uint16_t pixel = 0; pixel < 17; ++pixel)
        for (const TileLoop::Round round : {TileLoop::Round::mirrored, TileLoop::Round::bent, TileLoop::Round::none}) {
            trace::PathTask& task = loop.push(round);
            task.pixel = pixel, task.depth = static_cast<std::uint16_t>(round);
        }
    std::vector<int> counts;
    std::vector<std::pair<int, int>> order;
    loop.finish([&](std::span<trace::TilePacket> packets) {
        for (const trace::TilePacket& packet : packets) {
            counts.push_back(std::popcount(packet.active));
            for (int lane = 0; lane < counts.back(); ++lane)
                order.emplace_back(packet.tasks[lane].depth, packet.pixels[lane]);
        }
    });
    EXPECT_EQ(counts, (std::vector<int>{16, 16, 16, 3}));
    EXPECT_EQ(order.size(), 51u);
    EXPECT_TRUE(std::ranges::is_sorted(order));
    EXPECT_EQ(groups[0].secondaryRays, 51u);
}

}  // namespace
}  // namespace rtsg
