// Rooms that lose sound: told once each, with what is beside and its line; in reports of all forms; no false alarms.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <regex>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "listen_scene.h"

namespace rtsg {
namespace {

using namespace test;

constexpr const char* kVoice =
    "DEF Voice Sound { location 1 1 1.5 minBack 90 minFront 90 maxBack 200 maxFront 200 source "
    "OscillatorSource { frequency 440 } }\nViewpoint { position 4 3 1.5 }\n";

class ListenLeak : public Listen {
  protected:
    /// Faces of a box of 6 by 5 by 3 m, by corners; `last` stands for the upper half of the one at x = 6.
    static std::string hall(const std::string& last) {
        return "# about\nDEF Hall Shape { geometry IndexedFaceSet { solid FALSE coordIndex [ 0 4 6 2 -1 0 1 5 4 -1 "
               "2 6 7 3 -1 0 2 3 1 -1 4 5 7 6 -1 1 3 7 -1 " +
               last + " ] coord Coordinate { point [ 0 0 0 6 0 0 0 5 0 6 5 0 0 0 3 6 0 3 0 5 3 6 5 3 ] } } }\n";
    }
    static std::string box(const std::string& def, const std::string& size, const std::string& at) {
        return "Transform { translation " + at + " children DEF " + def + " Shape { geometry Box { size " + size +
               " } } }\n";
    }
    /// Six slabs, of which East begins `gap` beyond the ends of the walls beside it.
    static std::string slabs(double gap) {
        return box("Floor", "6.8 5.4 .2", "3.2 2.5 -.1") + box("Roof", "6.8 5.4 .2", "3.2 2.5 3.1") +
               box("West", ".2 5.4 3", "-.1 2.5 1.5") +
               box("East", ".1 5.4 3", std::to_string(6.05 + gap) + " 2.5 1.5") + box("South", "6 .2 3", "3 -.1 1.5") +
               box("North", "6.5 .2 3", "3.25 5.1 1.5");
    }
    static ListenOptions heardOptions(const ListenOptions& from) {
        ListenOptions o = from;
        o.seconds = .1;
        o.render.trace.rays = 2000;
        return o;
    }
    std::vector<std::string> heard(const std::string& body) {
        Scene scene;
        load(scene, body);
        return heard(scene, heardOptions(options()));
    }
    static std::vector<std::string> heard(Scene& scene, const ListenOptions& o) {
        const auto report = listen(scene, o);
        EXPECT_TRUE(report);
        std::vector<std::string> texts;
        if (report)
            for (const Diagnostic& d : report->diagnostics.all()) {
                EXPECT_EQ(d.code.text(), "leak") << d.format();
                texts.push_back(d.text);
            }
        return texts;
    }
};

TEST_F(ListenLeak, AForgottenTriangleIsToldWithItsPlaceAndItsLine) {
    const std::filesystem::path file = folder_ / "hall.x3dv";
    std::ofstream(file) << "#X3D V4.0 utf8\nPROFILE Full\n" + hall("") + kVoice;
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadFile(scene, file, diagnostics));
    ListenOptions o = heardOptions(options());
    o.metrics = true;
    o.render.document = file;
    const auto report = listen(scene, o);
    ASSERT_TRUE(report);
    // Found by the sound and by the figures, but reported once.
    ASSERT_EQ(report->diagnostics.all().size(), 1u);
    const Diagnostic& reported = report->diagnostics.all()[0];
    EXPECT_EQ(reported.code.text(), "leak");
    EXPECT_EQ(reported.severity, Severity::warning);
    EXPECT_EQ(reported.where.line, 4u);
    EXPECT_TRUE(reported.text.starts_with("some ")) << reported.text;
    EXPECT_NE(reported.text.find(" % of the sound of Voice leaves the room, "), std::string::npos) << reported.text;
    EXPECT_TRUE(std::regex_search(reported.text, std::regex(" % by a hole of [67][.0-9]* m2 near 6[.]")))
        << reported.text;
    EXPECT_TRUE(reported.text.ends_with(
        " beside Hall (IndexedFaceSet, 6 x 5 x 3 m about 3 2.5 1.5, line 4), which lacks a triangle"))
        << reported.text;
    ASSERT_EQ(report->sources.size(), 1u);
    const auto json = nlohmann::json::parse(report->toJson());
    const auto& losses = json["sources"][0]["losses"];
    EXPECT_EQ(losses["by"]["leak"], true);
    EXPECT_EQ(losses["by"]["beside"][0], "Hall");
    EXPECT_LE(losses["by"]["share"].get<double>(), losses["escaped"].get<double>() * 1.0001);
    EXPECT_NEAR(losses["escaped"].get<double>(), json["escaped"].get<double>(), 1e-6);
}

TEST_F(ListenLeak, ACrackNamesTheShapesOnBothSides) {
    const auto texts = heard(slabs(.01) + kVoice);
    ASSERT_EQ(texts.size(), 1u);
    EXPECT_TRUE(std::regex_search(texts[0], std::regex("by a crack of [23][.0-9]* m x .* near 6[.]0"))) << texts[0];
    EXPECT_NE(texts[0].find("East (Box, "), std::string::npos) << texts[0];
    EXPECT_NE(texts[0].find("South (Box, "), std::string::npos) << texts[0];
    EXPECT_EQ(texts[0].find("Floor"), std::string::npos) << texts[0];
}

/// Closed; in the open; with a door; a room that is open to one side; walls that let sound pass.
TEST_F(ListenLeak, NothingIsToldWhereNothingIsLostOrSomethingIsOpenOnPurpose) {
    EXPECT_TRUE(heard(hall("1 7 5 -1") + kVoice).empty());
    EXPECT_TRUE(heard(slabs(0) + kVoice).empty());
    EXPECT_TRUE(heard(box("Ground", "60 60 .2", "0 0 -.1") + box("Wall", "4 .2 3", "2 4 1.5") + kVoice).empty());
    EXPECT_TRUE(heard(box("Floor", "6.4 5.4 .2", "3 2.5 -.1") + box("Roof", "6.4 5.4 .2", "3 2.5 3.1") +
                      box("West", ".2 5.4 3", "-.1 2.5 1.5") + box("South", "6 .2 3", "3 -.1 1.5") +
                      box("North", "6 .2 3", "3 5.1 1.5") + kVoice)
                    .empty());
    EXPECT_TRUE(heard(box("Floor", "6.4 5.4 .2", "3 2.5 -.1") + box("Roof", "6.4 5.4 .2", "3 2.5 3.1") +
                      box("West", ".2 5.4 3", "-.1 2.5 1.5") + box("South", "6 .2 3", "3 -.1 1.5") +
                      box("North", "6 .2 3", "3 5.1 1.5") + box("EastA", ".2 2 3", "6.1 1 1.5") +
                      box("EastB", ".2 2 3", "6.1 4 1.5") + box("Lintel", ".2 1 1", "6.1 2.5 2.5") + kVoice)
                    .empty());
    EXPECT_TRUE(heard(room("absorption .1 refraction .1", kVoice)).empty());
}

/// A vent, for instance: the metadata of a shape beside say so, whoever finds it.
TEST_F(ListenLeak, WhatTheAuthorMeansIsNoLeak) {
    const std::string east = "DEF East Shape { ";
    for (const bool meant : {true, false}) {
        std::string body = slabs(.01) + kVoice;
        const std::string said =
            std::string("MetadataBoolean { name \"opening\" value ") + (meant ? "TRUE }" : "FALSE }");
        body.replace(body.find(east), east.size(),
                     east + "metadata MetadataSet { name \"acoustics\" value [ " + said + " ] } ");
        EXPECT_EQ(heard(body).size(), meant ? 0u : 1u);
        Scene scene;
        load(scene, body);
        SharedWorld world(scene);
        const auto report = SoundRenderer(world, options()).survey({{"A", {4, 3, 1.5}}});
        ASSERT_TRUE(report);
        EXPECT_EQ(report->diagnostics.all().size(), meant ? 0u : 1u);
        EXPECT_GT(report->losses[0].openings.fraction, 0);
        EXPECT_EQ(report->losses[0].openings.leak, !meant);
    }
}

TEST_F(ListenLeak, AReportAloneTellsThemOnce) {
    Scene scene;
    load(scene, slabs(.02) + kVoice);
    SharedWorld world(scene);
    SoundRenderer sound(world, options());
    const auto report = sound.survey({{"A", {4, 3, 1.5}}, {"B", {2, 4, 1}}});
    ASSERT_TRUE(report) << report.error().text;
    ASSERT_EQ(report->diagnostics.all().size(), 1u);
    EXPECT_EQ(report->diagnostics.all()[0].code.text(), "leak");
    EXPECT_TRUE(sound.finish().diagnostics.all().empty());
}

TEST_F(ListenLeak, ReportsOfAllFormsSayWhere) {
    Scene scene;
    load(scene, slabs(.02) + kVoice);
    SharedWorld world(scene);
    ListenOptions o = options();
    SoundRenderer sound(world, o);
    const auto report = sound.survey({{"A", {4, 3, 1.5}}, {"B", {2, 4, 1}}});
    ASSERT_TRUE(report) << report.error().text;
    ASSERT_EQ(report->losses.size(), 1u);
    const std::string text = report->toText(), page = report->toHtml();
    const std::regex said(
        "% of the sound of Voice leaves the room, [.0-9]+ % by a crack of 3[.0-9]* m x [.0-9]+ cm near");
    EXPECT_TRUE(std::regex_search(text, said)) << text;
    EXPECT_TRUE(std::regex_search(page, said));
    const auto json = nlohmann::json::parse(report->toJson());
    EXPECT_EQ(json["losses"][0]["source"], "Voice");
    EXPECT_NEAR(json["losses"][0]["by"]["area"].get<double>(), .06, .006);
    Scene closed;
    load(closed, slabs(0) + kVoice);
    SharedWorld closedWorld(closed);
    SoundRenderer closedSound(closedWorld, o);
    const auto whole = closedSound.survey({{"A", {4, 3, 1.5}}});
    ASSERT_TRUE(whole);
    EXPECT_EQ(whole->toText().find("leaves the room"), std::string::npos);
    EXPECT_EQ(whole->toHtml().find("leaves the room"), std::string::npos);
}

/// 86 % of the sound leaves, and rays do not agree about the rest: a T20 of .7 +- 2.9 s is none.
TEST_F(ListenLeak, AStreetCornerHasNoReverberationTime) {
    const auto item = [](const std::string& size, const std::string& at) {
        return "Transform { translation " + at + " children Shape { geometry Box { size " + size +
               " } appearance Appearance { acousticProperties AcousticProperties { absorption .1 diffuse .1 specular "
               ".8 "
               "} } } }\n";
    };
    const std::string walls = item("80 1 80", "0 -.5 0") + item("30 10 30", "20 5 20") + item("70 10 30", "0 5 -20");
    Scene scene;
    load(scene, walls +
                    "Transform { translation 0 1.5 15 children DEF Voice SpatialSound { children OscillatorSource "
                    "{ frequency 440 } } }\n");
    SharedWorld world(scene);
    ListenOptions o = options();
    o.trace.rays = 2000;
    SoundRenderer sound(world, o);
    const auto report = sound.survey({{"A", {14, 1.5, 0}}});
    ASSERT_TRUE(report) << report.error().text;
    const RoomReport::Pair& pair = report->pairs.at(0);
    EXPECT_GT(pair.escaped[kBand1k], .8);
    EXPECT_TRUE(std::isnan(pair.metrics.value.t20[kBand1k])) << pair.metrics.value.t20[kBand1k];
    EXPECT_TRUE(std::isfinite(pair.metrics.value.c80[kBand1k]));
    EXPECT_NE(report->toText().find("no reverberation time: "), std::string::npos);
    // A room that loses little has one.
    Scene closed;
    load(closed, slabs(.02) + kVoice);
    SharedWorld closedWorld(closed);
    SoundRenderer closedSound(closedWorld, o);
    const auto whole = closedSound.survey({{"A", {4, 3, 1.5}}});
    ASSERT_TRUE(whole);
    EXPECT_TRUE(std::isfinite(whole->pairs.at(0).metrics.value.t20[kBand1k]));
    EXPECT_EQ(whole->toText().find("no reverberation"), std::string::npos);
}

}  // namespace
}  // namespace rtsg
