// The overlay's content for a scene: its viewpoints, the rows that are open, the node that is picked.
#include <algorithm>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "view/overlay_maker.h"

namespace rtsg {
namespace {

struct Reported {
    Scene scene;
    std::optional<SharedWorld> world;
    std::optional<OverlayMaker> maker;

    explicit Reported(const std::string& text) {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Immersive\n" + text, diagnostics));
        scene.newFrame(0);
        world.emplace(scene);
        maker.emplace(*world);
    }
    OverlayContent content() {
        OverlayContent all;
        maker->fillViewpoints(all);
        maker->fill(all);
        return all;
    }
    NodeId node(const char* name) { return scene.findName(name); }
};

const char* const kYard = R"(Viewpoint { description "near" } DEF FAR Viewpoint { position 0 0 50 }
DEF YARD Group { children [ DEF POLE Transform { scale 1 2 3 children Shape { geometry Box { } } }
  DEF LAMP PointLight { } ] }
DEF CLOCK TimeSensor { } DEF PATH PositionInterpolator { key [0 1 2 3 4 5 6 7] keyValue [0 0 0 1 1 1] }
ROUTE CLOCK.fraction_changed TO PATH.set_fraction ROUTE PATH.value_changed TO POLE.translation)";

TEST(OverlayMakers, TheTreeShowsWhatIsOpen) {
    Reported reported(kYard);
    const auto row = [&](const char* name) -> OverlayContent::Row {
        const auto all = reported.content().tree;
        const auto at = std::ranges::find(all, std::string(name), &OverlayContent::Row::name);
        return at == all.end() ? OverlayContent::Row() : *at;
    };
    EXPECT_EQ(reported.content().tree.size(), 5u);
    EXPECT_TRUE(row("YARD").opens && row("YARD").hides && row("YARD").isVisible && !row("YARD").isOpen);
    EXPECT_FALSE(row("CLOCK").opens);
    EXPECT_FALSE(row("CLOCK").hides);
    EXPECT_EQ(row("POLE").node, 0u);
    reported.maker->toggle(reported.node("YARD"));
    EXPECT_TRUE(row("YARD").isOpen);
    EXPECT_EQ(row("POLE").depth, 1);
    EXPECT_EQ(row("POLE").type, "Transform");
    EXPECT_FALSE(row("LAMP").opens);
    ASSERT_TRUE(reported.scene.set(reported.node("YARD"), x3d::Group::visible, false));
    EXPECT_FALSE(row("YARD").isVisible);
    reported.maker->toggle(reported.node("YARD"));
    EXPECT_EQ(reported.content().tree.size(), 5u);
}

TEST(OverlayMakers, WhatARayMetIsPickedByItsName) {
    Reported reported(kYard);
    EXPECT_FALSE(reported.content().picked);
    const NodeId shape = reported.scene.node(reported.node("POLE")).get(x3d::Transform::children)[0];
    reported.maker->pickOnPath({reported.node("YARD"), reported.node("POLE"), shape});
    const auto all = reported.content();
    ASSERT_TRUE(all.picked);
    EXPECT_EQ(all.picked->name, "POLE") << "the innermost that has one";
    const auto picked = std::ranges::find(all.tree, true, &OverlayContent::Row::isPicked);
    ASSERT_NE(picked, all.tree.end()) << "the tree has opened there";
    EXPECT_EQ(picked->name, "POLE");
    EXPECT_EQ(all.picked->routes, std::vector<std::string>{"PATH.value_changed \xE2\x86\x92 POLE.translation"});
    const auto& fields = all.picked->fields;
    const auto field = std::ranges::find(fields, "scale", &OverlayContent::Field::name);
    ASSERT_NE(field, fields.end());
    EXPECT_EQ(field->value, "1 2 3");
    EXPECT_FALSE(field->isDefault);
    EXPECT_TRUE(std::ranges::is_sorted(fields, {}, &OverlayContent::Field::isDefault)) << "what was set comes first";
    EXPECT_EQ(std::ranges::find(fields, "children", &OverlayContent::Field::name)->node, shape.value);
    reported.maker->pick(reported.node("PATH"));
    const auto path = reported.content().picked->fields;
    EXPECT_EQ(std::ranges::find(path, "key", &OverlayContent::Field::name)->value, "8 values");
    reported.maker->pickOnPath({});
    EXPECT_TRUE(reported.content().picked) << "a click into the void changes nothing";
    ASSERT_TRUE(reported.scene.destroyNode(reported.node("PATH")));
    EXPECT_FALSE(reported.content().picked);
}

TEST(OverlayMakers, ViewpointsHaveTheirDescriptionsAndTheBoundOneIsMarked) {
    Reported reported(kYard);
    const auto views = reported.content().viewpoints;
    ASSERT_EQ(views.size(), 2u);
    EXPECT_EQ(views[0].name, "near");
    EXPECT_EQ(views[1].name, "FAR");
    EXPECT_TRUE(views[0].isBound && !views[1].isBound);
    ASSERT_TRUE(reported.scene.sendEvent(reported.node("FAR"), x3d::Viewpoint::set_bind.index, Value(true)));
    reported.scene.newFrame(1);
    EXPECT_TRUE(reported.content().viewpoints[1].isBound);
    EXPECT_EQ(reported.maker->triangles(), 12u);
}

TEST(OverlayMakers, AnEndlessListIsCutAndSaysSo) {
    std::string text;
    for (int i = 0; i < 1000; ++i) text += "WorldInfo { }\n";
    Reported reported(text);
    const auto rows = reported.content().tree;
    EXPECT_EQ(rows.size(), 301u);
    EXPECT_EQ(rows.back().name, "... and 700 more");
    EXPECT_EQ(rows.back().node, 0u);
}

}  // namespace
}  // namespace rtsg
