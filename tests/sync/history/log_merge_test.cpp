// Merging logs: both scenes are there, state by state, and what cannot be merged is refused.
#include <rtsg/sync/log_merge.h>

#include <algorithm>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/log_compact.h>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;

class Merging : public LogFolder {
  protected:
    static NodeId inMerged(NodeId id, std::uint32_t side) {
        return !id ? id : id.value == 1 ? NodeId{side == 0 ? 1u : 3u} : NodeId{2 * id.value + side};
    }
    static Value inMerged(const Value& value, std::uint32_t side) {
        if (value.type() == FieldType::SFNode) return Value(inMerged(value.as<NodeId>(), side));
        if (value.type() != FieldType::MFNode) return value;
        Array<NodeId> ids;
        for (const NodeId id : value.as<Array<NodeId>>()) ids.push_back(inMerged(id, side));
        return Value(std::move(ids));
    }
    static void expectHolds(const Scene& merged, const Scene& one, std::uint32_t side) {
        const Value children = one.node(one.root()).value(x3d::RtsgScene::children.index);
        EXPECT_EQ(merged.node(NodeId{2 + side}).value(x3d::Transform::children.index), inMerged(children, side));
        one.forEachNode([&](const Node& node) {
            if (node.id() == one.root()) return;
            const Node* const other = merged.find(inMerged(node.id(), side));
            ASSERT_TRUE(other) << node.id().value;
            EXPECT_EQ(other->type().name, node.type().name);
            EXPECT_EQ(other->scope(), inMerged(node.scope(), side));
            const std::string name(one.name(node.id()));
            EXPECT_EQ(merged.name(other->id()), name.empty() || node.scope() ? name : (side ? "B_" : "A_") + name);
            for (FieldIndex field = 0; field < node.type().fieldCount(); ++field)
                if (node.type().slot(field).offset != FieldDef::kNoOffset) {
                    EXPECT_EQ(other->value(field), inMerged(node.value(field), side))
                        << node.id().value << '.' << node.type().fields[field].name;
                }
            EXPECT_EQ(merged.routesFrom(other->id()).size(), one.routesFrom(node.id()).size());
        });
    }
};

TEST_F(Merging, EachStateHoldsBothLogsStates) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        record(file("a.rlog"), 30, seed, denseKeyframes());
        record(file("b.rlog"), 20 + static_cast<int>(5 * seed), seed + 100);
        const auto report = mergeLogs(file("a.rlog"), file("b.rlog"), file("m.rlog"));
        ASSERT_TRUE(report) << report.error().format();
        EXPECT_EQ(report->lacks, "");
        auto merged = Replayer::open(file("m.rlog")), a = Replayer::open(file("a.rlog")),
             b = Replayer::open(file("b.rlog"));
        ASSERT_TRUE(merged && a && b);
        const double start = (*a)->keyframes().front().time, startOfB = (*b)->keyframes().front().time;
        while (*(*merged)->step()) {
            const double t = (*merged)->time() - start;
            if (const auto next = (*merged)->nextTime(); next && *next - start <= t + 1e-6) continue;
            for (const auto& [one, begin] : {std::pair(a->get(), start), std::pair(b->get(), startOfB)})
                for (auto next = one->nextTime(); next && *next - begin <= t + 1e-6; next = one->nextTime())
                    ASSERT_TRUE(*one->step());
            if ((*a)->frames() > 0) expectHolds((*merged)->scene(), (*a)->scene(), 0);
            if ((*b)->frames() > 0) expectHolds((*merged)->scene(), (*b)->scene(), 1);
        }
        EXPECT_TRUE((*a)->atEnd() && (*b)->atEnd());
        EXPECT_EQ((*merged)->verified(), report->statesWritten);
        EXPECT_EQ((*a)->frames() + (*b)->frames(), report->statesRead);
    }
}

TEST_F(Merging, PrototypesOfBothLogsAndTimesAsTheyWere) {
    for (const auto& [name, color, from] :
         {std::tuple("a.rlog", "1 0 0", 100.), std::tuple("b.rlog", "0 1 0", 100.5)}) {
        Scene scene;
        Diagnostics diagnostics;
        scene.newFrame(from);
        ASSERT_TRUE(loadText(scene,
                             std::string("#X3D V4.0 utf8\nPROFILE Immersive\nPROTO Lamp [ inputOutput SFColor c ") +
                                 color + " ] { PointLight { color IS c } }\nDEF L Lamp { }\nDEF T Transform { }",
                             diagnostics));
        auto log = LogWriter::create(file(name), builtinTypes());
        ASSERT_TRUE(log);
        const Attachment attachment = scene.bus().attach(**log);
        for (int k = 1; k < 5; ++k) {
            ASSERT_TRUE(
                scene.set(scene.findName("T"), x3d::Transform::translation, Vec3f(static_cast<float>(k), 0, 0)));
            scene.newFrame(from + k);
        }
        ASSERT_TRUE((*log)->close());
    }
    MergeOptions options;
    options.bySceneTime = true;
    options.apart = 7;
    const auto report = mergeLogs(file("a.rlog"), file("b.rlog"), file("m.rlog"), options);
    ASSERT_TRUE(report) << report.error().format();
    auto merged = Replayer::open(file("m.rlog"));
    ASSERT_TRUE(merged);
    std::vector<double> times;
    while (*(*merged)->step()) times.push_back((*merged)->time());
    EXPECT_EQ(times, (std::vector<double>{100, 100.5, 101, 101.5, 102, 102.5, 103, 103.5, 104, 104.5}));
    const Scene& scene = (*merged)->scene();
    EXPECT_EQ((*merged)->verified(), times.size());
    const Node &a = scene.node(scene.findName("A_L")), &b = scene.node(scene.findName("B_L"));
    EXPECT_EQ(a.value(a.type().find("c")).as<Color>(), (Color{1, 0, 0}));
    EXPECT_EQ(b.value(b.type().find("c")).as<Color>(), (Color{0, 1, 0}));
    EXPECT_EQ(scene.node(scene.findName("B")).get(x3d::Transform::translation), Vec3f(7, 0, 0));
    EXPECT_EQ(scene.node(scene.findName("B_T")).get(x3d::Transform::translation), Vec3f(4, 0, 0));
    EXPECT_EQ(scene.node(scene.effectiveNode(a.id())->id()).type().name, "PointLight");
}

TEST_F(Merging, WhatCannotBeMergedIsRefused) {
    record(file("a.rlog"), 10, 1);
    record(file("b.rlog"), 10, 2);
    EXPECT_FALSE(mergeLogs(file("a.rlog"), file("b.rlog"), file("b.rlog")));
    EXPECT_FALSE(mergeLogs(file("a.rlog"), file("none.rlog"), file("m.rlog")));
    writeAll(file("two.rlog"), readAll(file("a.rlog")) + readAll(file("b.rlog")));
    const auto refused = mergeLogs(file("a.rlog"), file("two.rlog"), file("m.rlog"));
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().text.find("begins anew"), std::string::npos) << refused.error().text;
    EXPECT_EQ(refused.error().file, file("two.rlog").string());
    EXPECT_FALSE(std::filesystem::exists(file("m.rlog")));
    writeAll(file("m.rlog"), "mine");
    MergeOptions options;
    options.log.existing = Existing::keep;
    EXPECT_FALSE(mergeLogs(file("a.rlog"), file("b.rlog"), file("m.rlog"), options));
    EXPECT_EQ(readAll(file("m.rlog")), "mine");
    // A log that was not closed is merged as far as it goes, and named.
    const std::string bytes = readAll(file("b.rlog"));
    writeAll(file("cut.rlog"), std::string_view(bytes).substr(0, bytes.size() - 60));
    const auto lacking = mergeLogs(file("a.rlog"), file("cut.rlog"), file("c.rlog"));
    ASSERT_TRUE(lacking) << lacking.error().format();
    EXPECT_NE(lacking->lacks.find("cut.rlog"), std::string::npos) << lacking->lacks;
}

}  // namespace
}  // namespace rtsg
