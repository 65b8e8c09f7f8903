// The events that fields send: with a rate, the newest value is there at the end, too.
#include <rtsg/feeds/publisher.h>

#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "support/temp_folder.h"

namespace rtsg {
namespace {

TEST(Publisher, WhatWaitsForItsTurnAtTheEndIsWritten) {
    for (const bool closes : {true, false}) {
        test::TempFolder folder;
        const std::string file = folder / "lines";
        Scene scene;
        const NodeId box = scene.createNode(x3d::Transform::type);
        ASSERT_TRUE(scene.setName(box, "BOX"));
        PublishOptions options;
        options.target = file;
        options.fields = {"BOX.translation"};
        options.rate = 1;
        auto publisher = Publisher::start(scene, options);
        ASSERT_TRUE(publisher);
        for (int frame = 0; frame < 4; ++frame) {
            const double t = .1 * frame;
            (*publisher)->expect(t);
            ASSERT_TRUE(scene.sendEvent(box, x3d::Transform::translation.index, Vec3f(float(frame), 0, 0)));
            scene.newFrame(t);
            (*publisher)->frame(t);
        }
        if (closes) (*publisher)->close();
        publisher->reset();
        std::vector<std::string> lines;
        std::ifstream in(file);
        for (std::string line; std::getline(in, line);) lines.push_back(line);
        ASSERT_EQ(lines.size(), 2u);
        EXPECT_EQ(lines.back(), R"({"t":0.30000000000000004,"node":"BOX","field":"translation","value":[3,0,0]})");
    }
}

}  // namespace
}  // namespace rtsg
