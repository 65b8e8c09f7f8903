// Fields of a log as columns: rows, names, nodes that come and go, damage, and CSV.
#include <rtsg/sync/log_table.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;

class LogTables : public LogFolder {
  protected:
    /// Forty frames, a tenth of a second apart, of a box that goes a metre a second; a lamp is there from 1 s to 2 s.
    void recordBox(LogOptions options = {}) {
        Scene scene;
        Diagnostics diagnostics;
        ASSERT_TRUE(loadText(scene,
                             "#X3D V4.0 utf8\nPROFILE Immersive\nDEF BOX Transform { }\n"
                             "DEF W WorldInfo { title \"a \\\"b\\\", c\" info [ \"x\" \"y\" ] }\nDEF C Switch { }",
                             diagnostics));
        auto log = LogWriter::create(file(), builtinTypes(), options);
        ASSERT_TRUE(log);
        const Attachment attachment = scene.bus().attach(**log);
        NodeId lamp;
        for (int frame = 0; frame < 40; ++frame) {
            if (frame == 10) {
                lamp = scene.createNode(x3d::PointLight::type);
                ASSERT_TRUE(scene.setName(lamp, "LAMP"));
                ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, lamp));
            }
            if (frame == 20) {
                ASSERT_TRUE(scene.destroyNode(lamp));
            }
            const Vec3f to(static_cast<float>(frame) / 10, 0, 0);
            ASSERT_TRUE(scene.set(scene.findName("BOX"), x3d::Transform::translation, to));
            scene.newFrame(frame * .1);
        }
        ASSERT_TRUE((*log)->close());
    }
    static std::string csvOf(const LogTable& table) {
        std::string text;
        table.writeCsv([&](std::string_view piece) { text += piece; });
        return text;
    }
};

TEST_F(LogTables, EveryStateIsARow) {
    recordBox();
    const auto table = readTable(file(), {"BOX.translation"});
    ASSERT_TRUE(table) << table.error().format();
    ASSERT_EQ(table->columns().size(), 1u);
    const LogTable::Column& column = *table->columns().front();
    EXPECT_EQ(column.name, "BOX.translation");
    ASSERT_EQ(column.rows.size(), table->times().size());
    ASSERT_GE(column.rows.size(), 40u);
    for (std::size_t row = 1; row < column.rows.size(); ++row)
        EXPECT_NEAR(column.rows[row]->as<Vec3f>().x, table->times()[row], 1e-6);
}

TEST_F(LogTables, NodesThatAreNotThereHaveNoValue) {
    recordBox();
    const auto table = readTable(file(), {"LAMP.on*", "LAMP.intensity"});
    ASSERT_TRUE(table);
    ASSERT_EQ(table->columns().size(), 2u);
    EXPECT_EQ(table->columns()[1]->name, "LAMP.intensity");
    for (std::size_t row = 0; row < table->times().size(); ++row) {
        const double time = table->times()[row];
        EXPECT_EQ(table->columns()[0]->rows[row].has_value(), time > .95 && time < 1.95) << time;
    }
}

TEST_F(LogTables, APartOfTheStates) {
    recordBox();
    TableOptions options;
    options.from = 1, options.to = 2, options.every = 5;
    const auto table = readTable(file(), {"BOX.translation"}, options);
    ASSERT_TRUE(table);
    EXPECT_THAT(table->times(), testing::ElementsAre(1, 1.5, 2));
    EXPECT_FLOAT_EQ(table->columns()[0]->rows[1]->as<Vec3f>().x, 1.5F);
}

TEST_F(LogTables, CsvHasOneNumberAColumn) {
    recordBox();
    TableOptions options;
    options.from = .1, options.to = .1;
    const auto table =
        readTable(file(), {"BOX.translation", "BOX.rotation", "BOX.visible", "W.*", "C.whichChoice"}, options);
    ASSERT_TRUE(table) << table.error().format();
    EXPECT_EQ(csvOf(*table),
              "time,BOX.translation.x,BOX.translation.y,BOX.translation.z,BOX.rotation.x,BOX.rotation.y,BOX.rotation.z,"
              "BOX.rotation.angle,BOX.visible,W.info,W.metadata,W.title,C.whichChoice\n"
              "0.1,0.1,0,0,0,0,1,0,true,\"[\"\"x\"\", \"\"y\"\"]\",,\"a \"\"b\"\", c\",-1\n");
}

TEST_F(LogTables, WhatIsNotThereIsNamed) {
    recordBox();
    for (const char* const wrong : {"BOX.nothing", "NOBODY.translation", "NOBODY*.*"}) {
        const auto table = readTable(file(), {"BOX.translation", wrong});
        ASSERT_FALSE(table);
        EXPECT_THAT(table.error().text, testing::HasSubstr(wrong));
        EXPECT_EQ(table.error().code, DiagnosticCode("no-such-field"));
    }
    for (const char* const wrong : {"BOX", ".x", "BOX.", ""}) EXPECT_FALSE(readTable(file(), {wrong})) << wrong;
    EXPECT_FALSE(readTable(file("missing.rlog"), {"BOX.translation"}));
    EXPECT_THAT(readTable(file("missing.rlog"), {"BOX.translation"}).error().file, testing::HasSubstr("missing.rlog"));
}

TEST_F(LogTables, DamageIsToldAndSkipped) {
    LogOptions options;
    options.keyframeSeconds = 1;
    recordBox(options);
    const std::size_t states = readTable(file(), {"BOX.translation"})->times().size();
    const auto records = recordsOf(file());
    const auto frame = std::find_if(records.begin() + 20, records.end(),
                                    [](const auto& r) { return r.second.kind == RecordKind::frame; });
    ASSERT_NE(frame, records.end());
    std::string bytes = readAll(file());
    char& last = bytes[frame->first + frame->second.size() - 1];
    last = static_cast<char>(last ^ 1);
    writeAll(file(), bytes);
    std::optional<Divergence> lacks;
    const auto table = readTable(file(), {"BOX.translation"}, {}, &lacks);
    ASSERT_TRUE(table);
    ASSERT_TRUE(lacks);
    EXPECT_GT(lacks->time, 0);
    EXPECT_GT(table->times().size(), 20u);
    EXPECT_LT(table->times().size(), states);
}

TEST_F(LogTables, TimesOfTheDayAreToldToAMicrosecond) {
    EXPECT_EQ(sinceStart(1'700'000'000 + 1 / 30., 1'700'000'000), .033333);
    EXPECT_EQ(sinceStart(1 / 30., 0), 1 / 30.);
}

TEST_F(LogTables, CanBeCancelled) {
    recordBox();
    TableOptions options;
    options.progress = [](std::uint64_t, std::uint64_t) { return false; };
    const auto table = readTable(file(), {"BOX.translation"}, options);
    ASSERT_FALSE(table);
    EXPECT_EQ(table.error().text, "cancelled");
}

}  // namespace
}  // namespace rtsg
