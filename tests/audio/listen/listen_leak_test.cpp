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
    /// The warnings while something moves for some seconds.
    std::vector<std::string> heardWhile(const std::string& body, double seconds,
                                        const std::function<void(Scene&, double)>& move) {
        Scene scene;
        load(scene, body);
        ListenOptions o = heardOptions(options());
        o.seconds = seconds;
        o.render.trace.rays = 400;
        o.runTo = [&](double t) {
            move(scene, t);
            scene.newFrame(t);
        };
        return heard(scene, o);
    }
    /// slabs(), of which East may move away from the others.
    static std::string movable() {
        std::string body = slabs(0) + kVoice;
        const std::string east = box("East", ".1 5.4 3", std::to_string(6.05) + " 2.5 1.5");
        return body.replace(body.find(east), east.size(), "DEF ToEast Transform { children " + east + " }\n");
    }
    static void slide(Scene& scene, float along) {
        static_cast<void>(scene.set(scene.findName("ToEast"), x3d::Transform::translation, Vec3f(along, 0, 0)));
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
    EXPECT_TRUE(
        reported.text.starts_with("Hall (IndexedFaceSet, 6 x 5 x 3 m about 3 2.5 1.5, line 4) lacks a triangle at "
                                  "6 1.667 2, of 7.5 m2: some "))
        << reported.text;
    EXPECT_TRUE(reported.text.ends_with(" % of the sound of Voice is lost there")) << reported.text;
    ASSERT_EQ(report->sources.size(), 1u);
    const auto json = nlohmann::json::parse(report->toJson());
    const auto& losses = json["sources"][0]["losses"];
    ASSERT_EQ(losses["openings"].size(), 1u);
    EXPECT_EQ(losses["openings"][0]["kind"], "leak");
    EXPECT_EQ(losses["openings"][0]["boundary_edges"], 3);
    EXPECT_EQ(losses["openings"][0]["beside"][0]["shape"], "Hall");
    EXPECT_NEAR(losses["openings"][0]["share"].get<double>() + losses["elsewhere"].get<double>(),
                losses["escaped"].get<double>(), 1e-6);
    EXPECT_NEAR(losses["escaped"].get<double>(), json["escaped"].get<double>(), 1e-6);
}

/// In text and page, energy that leaves by none of the openings has a row of its own, if there is any.
TEST_F(ListenLeak, WhatGoesElsewhereHasARowOfItsOwn) {
    RoomReport report;
    RoomReport::Losses losses;
    losses.source = "Voice";
    losses.openings.escaped = .25;
    losses.openings.elsewhere = .125;
    report.losses.push_back(losses);
    EXPECT_NE(report.toHtml().find("<th>other</th><td>12 %"), std::string::npos) << report.toHtml();
    report.losses[0].openings.elsewhere = 0;
    EXPECT_EQ(report.toHtml().find("<th>other</th>"), std::string::npos);
}

TEST_F(ListenLeak, ACrackNamesTheShapesOnBothSides) {
    const auto texts = heard(slabs(.01) + kVoice);
    ASSERT_EQ(texts.size(), 1u);
    EXPECT_TRUE(texts[0].starts_with("there is a crack at 6.00")) << texts[0];
    EXPECT_NE(texts[0].find(", 3 m x 10 mm, between "), std::string::npos) << texts[0];
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

TEST_F(ListenLeak, WhatOpensLaterIsToldToo) {
    const auto eastOpens = [](Scene& scene, double t) { slide(scene, t > .3 ? .04f : 0.0f); };
    // Closed until then; or with a leak elsewhere that was told before.
    const auto closed = heardWhile(movable(), 1.2, eastOpens);
    ASSERT_EQ(closed.size(), 1u);
    EXPECT_NE(closed[0].find("East (Box, "), std::string::npos) << closed[0];
    std::string body = movable();
    const std::string north = box("North", "6.5 .2 3", "3.25 5.1 1.5");
    body.replace(body.find(north), north.size(), box("North", "6.5 .2 2.98", "3.25 5.1 1.49"));
    const auto both = heardWhile(body, 1.2, eastOpens);
    ASSERT_EQ(both.size(), 2u);
    EXPECT_NE(both[0].find("North"), std::string::npos) << both[0];
    EXPECT_NE(both[1].find("East (Box, "), std::string::npos) << both[1];
}

/// Two rooms with a crack each. The first source goes from one to the other, with the listener; what it sought in the
/// one says nothing of the other, where the second comes beside it.
TEST_F(ListenLeak, ASourceThatCameAlongSaysNothingOfTheRoom) {
    const auto voice = [](const char* name, const char* enabled) {
        return fmt::format(
            "DEF To{0} Transform {{ children DEF {0} Sound {{ enabled {1} location 1 1 1.5 minBack 90 minFront 90 "
            "maxBack 200 maxFront 200 source OscillatorSource {{ frequency 440 }} }} }}\n",
            name, enabled);
    };
    const std::string unnamed = std::regex_replace(slabs(.04), std::regex("DEF [A-Z][a-z]* "), "");
    const auto reported = heardWhile(
        slabs(.04) + "Transform { translation 30 0 0 children [ " + unnamed + " ] }\n" + voice("First", "TRUE") +
            voice("Second", "TRUE") + "DEF ToEar Transform { children Viewpoint { position 4 3 1.5 } }\n",
        2, [](Scene& scene, double t) {
            const Vec3f at(t > .5 ? 30 : 0, 0, 0);
            for (const char* moved : {"ToFirst", "ToEar"})
                static_cast<void>(scene.set(scene.findName(moved), x3d::Transform::translation, at));
            static_cast<void>(
                scene.set(scene.findName("ToSecond"), x3d::Transform::translation, Vec3f(30, t > 1.2 ? 0 : 500, 0)));
        });
    ASSERT_EQ(reported.size(), 2u) << testing::PrintToString(reported);
    EXPECT_TRUE(reported[0].starts_with("there is a crack at 6.0") && reported[0].find("First") != std::string::npos)
        << reported[0];
    EXPECT_TRUE(reported[1].starts_with("there is a crack at 36.0") && reported[1].find("Second") != std::string::npos)
        << reported[1];
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
        ASSERT_EQ(report->losses[0].openings.openings.size(), 1u);
        EXPECT_EQ(report->losses[0].openings.openings[0].leak, !meant);
    }
}

/// A door that opens, as a crack first, is none; what shakes for long is looked for all the same.
TEST_F(ListenLeak, WhatMovesIsWaitedForAWhile) {
    EXPECT_TRUE(heardWhile(movable(), 1.6, [](Scene& scene, double t) {
                    slide(scene, static_cast<float>(std::clamp(t - .2, 0.0, .8)));
                }).empty());
    const auto shaken = heardWhile(movable(), 6, [](Scene& scene, double t) {
        if (t > .2) slide(scene, .02f + static_cast<float>(.002 * std::sin(9 * t)));
    });
    EXPECT_EQ(shaken.size(), 1u);
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

TEST_F(ListenLeak, ReportsOfAllFormsHaveATableOfThem) {
    Scene scene;
    load(scene, slabs(.02) + kVoice);
    SharedWorld world(scene);
    ListenOptions o = options();
    SoundRenderer sound(world, o);
    const auto report = sound.survey({{"A", {4, 3, 1.5}}, {"B", {2, 4, 1}}});
    ASSERT_TRUE(report) << report.error().text;
    ASSERT_EQ(report->losses.size(), 1u);
    ASSERT_EQ(report->losses[0].openings.openings.size(), 1u);
    const std::string text = report->toText(), page = report->toHtml();
    EXPECT_NE(text.find("\nsound that leaves the room, of all that a source emits\n  Voice: "), std::string::npos);
    EXPECT_NE(text.find("    leak "), std::string::npos) << text;
    // How it lies in the crack depends on the ray that found it.
    EXPECT_TRUE(std::regex_search(text, std::regex("3[.0-9]* m x [.0-9]+ cm \\(0\\.0[56]"))) << text;
    EXPECT_NE(page.find("<h2>Sound that leaves the room</h2>"), std::string::npos);
    EXPECT_TRUE(std::regex_search(page, std::regex("<td>3[.0-9]* m x [.0-9]+ cm</td>")));
    const auto json = nlohmann::json::parse(report->toJson());
    EXPECT_EQ(json["losses"][0]["source"], "Voice");
    EXPECT_NEAR(json["losses"][0]["openings"][0]["area"].get<double>(), .06, .001);
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
