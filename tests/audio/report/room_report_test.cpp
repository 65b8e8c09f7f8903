// Reports of rooms: averages against their formulas, curves against closed forms, and pages that stand alone.
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <rtsg/audio/room_report.h>

#include "audio/listen/listen_scene.h"

namespace rtsg {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// exp(-13.8155 t / T) of energy left at time t after `first`.
Echogram exponentialDecay(double reverberationTime, double first = 0) {
    Echogram echogram;
    const double k = 6 * std::log(10.0) / reverberationTime;
    echogram.late.start = first;
    for (int i = 0; i < static_cast<int>(3000 * reverberationTime); ++i)
        echogram.late.bins.push_back(allBands(std::exp(-k * i / 1000.0) - std::exp(-k * (i + 1) / 1000.0)));
    return echogram;
}

RoomReport::Pair pair(const std::string& source, double t30, double c80) {
    RoomReport::Pair result;
    result.source = source;
    result.listener = "seat";
    RoomMetrics& m = result.metrics.value;
    for (Bands* figure : {&m.edt, &m.t20, &m.t30}) *figure = allBands(t30);
    for (Bands* figure : {&m.c50, &m.c80, &m.g}) *figure = allBands(c80);
    m.d50 = m.ts = allBands(.5);
    result.echogram = exponentialDecay(t30);
    return result;
}

TEST(RoomReport, AveragesArithmeticallyOverThePairsThatHaveAFigure) {
    RoomReport report;
    report.pairs = {pair("A", 1, 3), pair("B", 1.2, -1), pair("C", 1.7, kNan)};
    report.pairs[0].metrics.value.t30[kBand1k - 1] = 2;
    const RoomReport::Average all = report.average();
    EXPECT_NEAR(all.mean.t30[kBand1k], 1.3, 1e-12);
    EXPECT_NEAR(all.deviation.t30[kBand1k], std::sqrt((.09 + .01 + .16) / 2), 1e-12);
    EXPECT_NEAR(all.mean.c80[kBand1k], 1, 1e-12);
    EXPECT_NEAR(all.deviation.c80[kBand1k], std::sqrt(8.0), 1e-12);
    EXPECT_EQ(all.count.t30[kBand1k], 3);
    EXPECT_EQ(all.count.c80[kBand1k], 2);
    // ISO 3382-1, table A.1: the mean of 500 and 1000 Hz.
    EXPECT_NEAR(RoomReport::single(all.mean.t30), ((2 + 1.2 + 1.7) / 3 + 1.3) / 2, 1e-12);
    report.pairs.resize(1);
    EXPECT_TRUE(std::isnan(report.average().deviation.t30[kBand1k]));
    report.pairs.clear();
    EXPECT_TRUE(std::isnan(report.average().mean.t30[kBand1k]));
    EXPECT_EQ(report.average().count.t30[kBand1k], 0);
}

TEST(RoomReport, SaysWhichBandsDecayWithTwoSlopes) {
    RoomReport report;
    report.pairs = {pair("A", 1, 3)};
    EXPECT_EQ(report.toText().find("slope"), std::string::npos);
    EXPECT_EQ(report.toHtml().find("slope"), std::string::npos);
    report.pairs[0].metrics.value.t30[kBand1k - 3] = 2;
    report.pairs[0].metrics.value.t30[kBand1k - 1] = 1.5;
    report.pairs[0].metrics.slopes[kBand1k - 1] = {1.45, 5.6};
    const std::string said = "more than one slope, as of coupled rooms, at 125 Hz, 500 Hz (1.45 and 5.6 s)";
    EXPECT_NE(report.toText().find("  " + said + "\n"), std::string::npos);
    EXPECT_NE(report.toHtml().find("<p>Decays with " + said + ".</p>"), std::string::npos);
    const auto json = nlohmann::json::parse(report.toJson());
    EXPECT_EQ(json["pairs"][0]["two_slopes"].dump(), "[false,false,true,false,true,false,false,false,false,false]");
    EXPECT_NEAR(json["pairs"][0]["curvature_percent"][kBand1k - 3].get<double>(), 100, 1e-9);
    EXPECT_EQ(json["pairs"][0]["early_slope_s"].dump(), "[null,null,null,null,1.45,null,null,null,null,null]");
    EXPECT_EQ(json["pairs"][0]["late_slope_s"][kBand1k - 1].get<double>(), 5.6);
}

TEST(RoomReport, SaysWhereMostSoundLeavesThatThereIsNoReverberationTime) {
    RoomReport report;
    report.pairs = {pair("A", kNan, 3)};
    EXPECT_EQ(report.toText().find("no reverberation"), std::string::npos) << "for another reason";
    report.pairs[0].escaped = allBands(.87);
    const std::string said = "no reverberation time: 87 % of the sound leaves, and what comes back is no decay";
    EXPECT_NE(report.toText().find("  " + said + "\n"), std::string::npos) << report.toText();
    EXPECT_NE(report.toHtml().find("<p>There is " + said + ".</p>"), std::string::npos);
    report.pairs[0].metrics.value.t20 = allBands(1.1);
    EXPECT_EQ(report.toText().find("no reverberation"), std::string::npos) << "one that is known";
}

TEST(RoomReport, DrawsTheDecayInClosedForm) {
    const std::vector<double> curve = decayCurveDb(exponentialDecay(.8, .01), 2, .01);
    ASSERT_GT(curve.size(), 80u);
    for (std::size_t k = 0; k < 80; ++k) EXPECT_NEAR(curve[k], -60 * .01 * static_cast<double>(k) / .8, 1e-3) << k;
    EXPECT_LT(curve.back(), -65);
    EXPECT_GT(curve[curve.size() - 2], -65);
    EXPECT_TRUE(decayCurveDb({}, 0, .01).empty());
}

std::size_t count(const std::string& text, const std::string& what) {
    std::size_t result = 0;
    for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++result;
    return result;
}

TEST(RoomReport, ThePageNeedsNothingElse) {
    RoomReport report;
    report.title = "a <hall> & \"more\" \x1b";
    report.pairs = {pair("A<b>", 1, 3), pair("B", 1.2, -1)};
    const std::string page = report.toHtml();
    // A plan, reverberation times, and three charts a pair.
    EXPECT_EQ(count(page, "<svg "), 8u);
    EXPECT_EQ(count(page, "class=\"decay\""), 2u * kBandCount);
    EXPECT_EQ(count(page, "http"), 0u);
    EXPECT_EQ(count(page, "src="), 0u);
    EXPECT_EQ(count(page, "<script"), 0u);
    EXPECT_EQ(count(page, "A<b>"), 0u);
    EXPECT_EQ(count(page, "\x1b"), 0u);
    EXPECT_NE(page.find("a &lt;hall&gt; &amp; &quot;more&quot; ?"), std::string::npos);
    for (const char* tag :
         {"table", "tr", "td", "th", "svg", "p", "h2", "h3", "text", "i", "b", "div", "span", "section"})
        EXPECT_EQ(count(page, std::string("<") + tag + ">") + count(page, std::string("<") + tag + " "),
                  count(page, std::string("</") + tag + ">"))
            << tag;
    // A line of 60 dB in a second, drawn from the upper left corner to the lower right one.
    const std::size_t line = page.find("<polyline points=\"34.0,24.0 ");
    ASSERT_NE(line, std::string::npos);
}

/// On the axis of the energogram, which begins with what comes first at all.
TEST(RoomReport, DrawsDecaysFromTheirOnsetOn) {
    RoomReport report;
    report.pairs = {pair("A", 1, 3)};
    Echogram& echogram = report.pairs[0].echogram = exponentialDecay(1, .07);
    echogram.arrivals.push_back({.02, allBands(1e-3), {}, 0});
    echogram.arrivals.push_back({.07, allBands(1), {}, 0});
    echogram.arrivals[0].energy[kBand1k] = .02;
    // To -60 dB in .95 s, as half is direct sound; .05 s on the 186 pixels of that and these .05 s, in each panel.
    const std::string page = report.toHtml();
    for (int b = 0; b < kBandCount; ++b) {
        const double x = 34 + 208 * (b % 5) + (b == kBand1k ? 0 : 186 * .05), y = b < 5 ? 24 : 186;
        EXPECT_EQ(count(page, fmt::format("<polyline points=\"{:.1f},{:.1f} ", x, y)), 1u) << b;
    }
}

/// Colours are those of the interval over the difference that is noticed; what is below Schroeder's frequency is grey.
TEST(RoomReport, ThePageColoursByNoticeableDifferences) {
    RoomReport report;
    report.pairs = {pair("A", 1, 3)};
    RoomReport::Pair& one = report.pairs[0];
    const std::string plain = report.toHtml();
    EXPECT_EQ(count(plain, "<td class=\"q2\">"), 0u);
    EXPECT_EQ(count(plain, "<td class=\"low\">"), 0u);
    EXPECT_EQ(count(plain, "class=\"fit t20\""), std::size_t{kBandCount});
    one.metrics.ci95.t20 = allBands(.04);  // of .05
    one.metrics.ci95.g = allBands(1.2);    // of 1
    one.metrics.ci95.c80 = allBands(.4);
    const std::string page = report.toHtml();
    EXPECT_EQ(count(page, "<td class=\"q2\">1.000<i>&#177;0.040</i></td>"), std::size_t{kBandCount});
    EXPECT_EQ(count(page, "<td class=\"q3\">3.00<i>&#177;1.20</i></td>"), std::size_t{kBandCount});
    EXPECT_EQ(count(page, "<td class=\"q1\">3.00<i>&#177;0.40</i></td>"), std::size_t{kBandCount});
    one.schroederHz = 100;
    const std::string low = report.toHtml();
    EXPECT_EQ(count(low, "<td class=\"q2\">1.000<i>&#177;0.040</i></td>"), kBandCount - 2u);
    EXPECT_EQ(count(low, "<td class=\"low\">1.000<i>&#177;0.040</i></td>"), 2u);
    EXPECT_NE(low.find("below 100 Hz (Schroeder)"), std::string::npos);

    // With several places, the colour shows how far each is from the mean.
    report.pairs = {pair("A", 1, 3), pair("B", 1, 3), pair("C", 1, 0)};
    const std::string positions = report.toHtml();
    EXPECT_EQ(count(positions, "<td class=\"l2\">0.00</td>"), 3u) << "2 dB below the mean: C50, C80 and G";
    EXPECT_EQ(count(positions, "<td class=\"h2\">"), 0u);
}

TEST(RoomReport, TellsTheRoomAndHowSpeechIsUnderstood) {
    RoomReport report;
    report.pairs = {pair("A", 1, 3), pair("B", 1, 3)};
    report.pairs[0].speech.sti = .6, report.pairs[0].speech.ci95 = .01;
    report.pairs[1].speech.sti = .5;
    report.speech.noise = allBands(40);
    report.room.volume = 90, report.room.surface = 126;
    report.room.box = {glm::dvec3(0), glm::dvec3(6, 3, 5)};
    report.materials = {{"brick <1>", 100, {}}, {"wood", 26, {}}};
    report.sabine = allBands(1.1), report.eyring = allBands(1.05);
    report.plan.lines = {{glm::dvec2(0, 0), glm::dvec2(6, 0)}};
    EXPECT_NEAR(report.meanSpeech(), .55, 1e-12);
    EXPECT_NEAR(report.schroederHz(), 2000 * std::sqrt(1.1 / 90), 1e-9);
    const auto json = nlohmann::json::parse(report.toJson());
    EXPECT_EQ(json["pairs"][0]["STI"], .6);
    EXPECT_EQ(json["pairs"][0]["STI_ci95"], .01);
    EXPECT_EQ(json["single"]["STI"], .55);
    EXPECT_EQ(json["room"]["volume_m3"], 90);
    EXPECT_EQ(json["room"]["materials"][1]["name"], "wood");
    EXPECT_EQ(json["speech"]["noise_db"][4], 40);
    EXPECT_TRUE(json["pairs"][0]["LF"][0].is_null());
    EXPECT_TRUE(json["pairs"][0].contains("IACC_early"));
    const std::string text = report.toText();
    for (const char* said :
         {"room around the first source: 90 m3, 126 m2, mean free path 2.86 m", "100.0 m2 of brick <1>", "Sabine, s",
          "STI             0.600 +- 0.010 D", "male speech of 60 dB(A) at 1 m, background noise of 40, 40,"})
        EXPECT_NE(text.find(said), std::string::npos) << said;
    const std::string page = report.toHtml();
    EXPECT_NE(page.find("brick &lt;1&gt;"), std::string::npos);
    EXPECT_NE(page.find("<b>STI 0.600</b> &#177;0.010 (D)"), std::string::npos);
    EXPECT_NE(page.find("M26.0 26.0L515.6 26.0"), std::string::npos) << "5 m on 408 pixels, and 6 m by that";
    EXPECT_EQ(count(page, "<tr><th>S1</th>"), 1u);
}

using ReportOfScene = test::Listen;

TEST_F(ReportOfScene, MeasuresEverySourceAtEveryListener) {
    Scene scene;
    load(
        scene,
        test::room("absorption .2 diffuse .8 specular 0",
                   "DEF S1 Sound { location 1 1 1.5 maxBack 90 maxFront 90 source AudioClip { url \"impulse.wav\" } }\n"
                   "DEF S2 Sound { location 5 4 2 maxBack 90 maxFront 90 source AudioClip { url \"impulse.wav\" } }\n"
                   "DEF V Viewpoint { position 4 3 1.5 }\n"
                   "DEF L1 ListenerPointSource { position 2 3 1.2 }\nDEF L2 ListenerPointSource { position 4 1 1.2 }\n"
                   "DEF L3 ListenerPointSource { position 4 2 1.2 enabled FALSE }\n"));
    SharedWorld world(scene);
    ListenOptions asked = options();
    asked.trace.rays = 3000;
    SoundRenderer sound(world, asked);
    auto report = sound.survey();
    ASSERT_TRUE(report) << report.error().text;
    ASSERT_EQ(report->pairs.size(), 4u);
    EXPECT_EQ(report->pairs[1].source, "S1");
    EXPECT_EQ(report->pairs[1].listener, "L2");
    EXPECT_EQ(report->pairs[1].listenerAt, glm::dvec3(4, 1, glm::dvec3(Vec3f(1.2f)).x));
    // Listeners share the rays of a source.
    EXPECT_GE(report->rays, 6000u);
    EXPECT_LT(report->rays, 6100u);
    // A diffuse room: about Eyring's time, wherever one is.
    const double volume = 90, area = 2 * (30 + 18 + 15);
    const double eyring = 24 * std::log(10.0) / 343 * volume / (-area * std::log(.8));
    EXPECT_NEAR(RoomReport::single(report->average().mean.t20) / eyring, 1, .1);
    EXPECT_NEAR(report->pairs[2].metrics.value.t20[kBand1k] / eyring, 1, .1);

    // Walls are alike in all bands, and the air takes nothing: one stands for ten, and the report says so.
    EXPECT_EQ(report->bandsTraced(), 1);
    EXPECT_EQ(report->bandsMeasured(), 1);
    const std::string computed = "Octave bands: 10; walls tell 1 of them apart, figures 1: no others are computed";
    EXPECT_NE(report->toText().find(computed + "\n"), std::string::npos);
    EXPECT_NE(report->toHtml().find(">" + computed + ".</p>"), std::string::npos);
    // The box around them, and speech in it.
    EXPECT_NEAR(report->room.volume, 90, .5);
    EXPECT_NEAR(report->room.surface, 126, 1);
    EXPECT_NEAR(report->eyring[kBand1k] / eyring, 1, .01);
    ASSERT_EQ(report->materials.size(), 1u);
    EXPECT_EQ(report->plan.lines.size(), 8u);
    EXPECT_EQ(report->plan.height, 3);
    for (const RoomReport::Pair& pair : report->pairs) {
        EXPECT_GT(pair.speech.sti, .6);
        EXPECT_LT(pair.speech.sti, .85);
        EXPECT_LT(pair.speech.ci95, .03);
        EXPECT_GT(pair.metrics.value.lf[kBand1k], .05);
        EXPECT_LT(pair.metrics.value.lf[kBand1k], .5);
        EXPECT_GT(pair.metrics.value.iaccEarly[kBand1k], pair.metrics.value.iaccLate[kBand1k]);
    }
    EXPECT_EQ(nlohmann::json::parse(report->toJson())["bands_computed"].dump(), "{\"figures\":1,\"walls\":1}");

    auto chosen = sound.survey({{"mine", {3, 3, 1}}});
    ASSERT_TRUE(chosen);
    ASSERT_EQ(chosen->pairs.size(), 2u);
    EXPECT_EQ(chosen->pairs[0].listener, "mine");
    const std::string json = chosen->toJson();
    EXPECT_NE(json.find("\"listener_position\":[3,3,1]"), std::string::npos) << json;
    EXPECT_NE(chosen->toText().find("S2 at 5.00 4.00 2.00, heard from mine at 3.00 3.00 1.00"), std::string::npos);
}

TEST_F(ReportOfScene, ViewpointsAreListenedAtWhereThereIsNoListener) {
    Scene scene;
    load(scene, test::kPair + "Transform { translation 1 0 0 children DEF Seat Viewpoint { position 1 1 1 } }");
    SharedWorld world(scene);
    SoundRenderer sound(world, options());
    const auto report = sound.survey();
    ASSERT_TRUE(report);
    ASSERT_EQ(report->pairs.size(), 2u);
    EXPECT_EQ(report->pairs[1].listener, "Seat");
    EXPECT_EQ(report->pairs[1].listenerAt, glm::dvec3(2, 1, 1));
    Scene silent;
    load(silent, "Viewpoint { }");
    SharedWorld empty(silent);
    SoundRenderer none(empty, options());
    EXPECT_FALSE(none.survey());
}

}  // namespace
}  // namespace rtsg
