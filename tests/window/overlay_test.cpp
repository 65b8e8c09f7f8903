// The overlay without a window: what it draws and where, and what a pointer does in it.
#ifdef RTSG_HAS_OVERLAY
#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "../../window/sdl_module/overlay.h"

namespace rtsg {
namespace {

using Kind = OverlayAction::Kind;

constexpr int kAcross = 800, kDown = 600;

struct Screen {
    std::vector<std::uint8_t> pixels = std::vector<std::uint8_t>(std::size_t{4} * kAcross * kDown, 90);
    PixelRows rows() { return {pixels.data(), kAcross, kDown, 4 * kAcross}; }
    bool isTouched(int x, int y) const {
        const std::uint8_t* p = pixels.data() + 4 * (std::ptrdiff_t{y} * kAcross + x);
        return p[0] != 90 || p[1] != 90 || p[2] != 90;
    }
};

OverlayContent content() {
    OverlayContent all;
    all.hasDetails = true;
    all.lines = {{"triangles", "1234", false, {}}, {"hash", "not the origin's", true, {}}};
    all.frameTimes = {30, 33, 70};
    all.budget = 33;
    all.viewpoints = {{11, "Door", true}, {12, "Roof", false}};
    all.tree = {{21, 0, "HALL", "Group", true, true, false, true, true},
                {22, 1, "FLAG", "Transform", false, false, true, true, false}};
    OverlayContent::Picked picked;
    picked.node = 22, picked.name = "FLAG", picked.type = "Transform #22";
    picked.fields = {{"translation", "0 2 0", false, 0}, {"children", "CLOTH", false, 23}};
    picked.routes = {"FLAG.translation > A.b"};
    all.picked = picked;
    all.hasHistory = true;
    auto marks = std::make_shared<std::vector<OverlayContent::Mark>>();
    marks->push_back({30, "Ann: FLAG.translation", false});
    all.timeline = OverlayContent::Timeline{10, 60, 1, marks};
    return all;
}

struct Shown {
    Overlay overlay;
    Screen screen;
    explicit Shown(const OverlayContent& all = content()) {
        overlay.set(std::make_shared<const OverlayContent>(all));
        overlay.paint(screen.rows());
        (void)overlay.takeActions();
    }
    std::vector<OverlayAction> click(int x, int y) {
        const auto px = static_cast<float>(x), py = static_cast<float>(y);
        (void)overlay.pointer(px, py, false);
        (void)overlay.pointer(px, py, true);
        (void)overlay.pointer(px, py, false);
        return overlay.takeActions();
    }
    /// The actions of clicks at every place in a column.
    std::vector<OverlayAction> clicksDown(int x, int from = 0, int to = kDown - 90) {
        std::vector<OverlayAction> all;
        for (int y = from; y < to; y += 4)
            for (const OverlayAction& action : click(x, y)) all.push_back(action);
        return all;
    }
};

bool has(const std::vector<OverlayAction>& actions, Kind kind, std::uint32_t node) {
    return std::ranges::any_of(actions, [&](const OverlayAction& a) { return a.kind == kind && a.node == node; });
}

TEST(Overlays, PanelsAreDrawnAtTheSidesAndThePictureIsLeftBetween) {
    const auto drawn = [](const OverlayContent& all) { return Shown(all).screen; };
    const Screen screen = drawn(content());
    EXPECT_TRUE(screen.isTouched(40, 40));
    EXPECT_TRUE(screen.isTouched(kAcross - 40, 40));
    EXPECT_TRUE(screen.isTouched(kAcross / 2, kDown - 40)) << "the time line";
    for (int y = 0; y < kDown - 90; y += 7) EXPECT_FALSE(screen.isTouched(kAcross / 2, y)) << y;
    EXPECT_TRUE(drawn(content()).pixels == screen.pixels) << "what is equal looks the same";
    OverlayContent other = content();
    other.lines[0].value = "1235";
    EXPECT_FALSE(drawn(other).pixels == screen.pixels);
}

TEST(Overlays, WhatIsClickedIsTold) {
    Shown shown;
    const auto left = shown.clicksDown(60);
    EXPECT_TRUE(has(left, Kind::viewpoint, 11));
    EXPECT_TRUE(has(left, Kind::viewpoint, 12));
    const auto rows = shown.clicksDown(kAcross - 120);
    EXPECT_TRUE(has(rows, Kind::pick, 21));
    EXPECT_TRUE(has(rows, Kind::pick, 22));
    EXPECT_TRUE(has(rows, Kind::pick, 23)) << "a field leads to the node that is in it";
    std::vector<OverlayAction> edges;
    for (int x = kAcross - 240; x < kAcross; x += 4)
        for (const OverlayAction& action : shown.clicksDown(x, 20, 120)) edges.push_back(action);
    EXPECT_TRUE(has(edges, Kind::open, 21));
    EXPECT_TRUE(has(edges, Kind::hide, 21));
    EXPECT_TRUE(has(edges, Kind::hide, 22));
    std::vector<OverlayAction> names;
    for (int x = kAcross - 220; x < kAcross - 140; x += 8)
        for (const OverlayAction& action : shown.clicksDown(x, kDown / 4)) names.push_back(action);
    EXPECT_TRUE(std::ranges::any_of(
        names, [](const auto& a) { return a.kind == Kind::history && a.node == 22 && a.name == "translation"; }));
}

TEST(Overlays, TheTimeLineIsClickedAndDragged) {
    Shown shown;
    const int y = kDown - 30;
    const auto middle = shown.click(kAcross / 2, y);
    ASSERT_EQ(middle.size(), 1u);
    EXPECT_EQ(middle[0].kind, Kind::seek);
    EXPECT_NEAR(middle[0].number, 30, .5);
    (void)shown.overlay.pointer(kAcross / 2, static_cast<float>(y), true);
    EXPECT_TRUE(shown.overlay.pointer(kAcross - 1, 5, true)) << "held, wherever it goes";
    const auto dragged = shown.overlay.takeActions();
    ASSERT_FALSE(dragged.empty());
    EXPECT_NEAR(dragged.back().number, 60, .01);
    EXPECT_TRUE(shown.overlay.pointer(kAcross - 1, 5, false));
    EXPECT_FALSE(shown.overlay.pointer(kAcross / 2, 5, false));
    std::vector<Kind> controls;
    for (int x = 10; x < 300; x += 4)
        for (const OverlayAction& action : shown.click(x, kDown - 62)) controls.push_back(action.kind);
    for (const Kind kind : {Kind::pause, Kind::step, Kind::rate})
        EXPECT_NE(std::ranges::find(controls, kind), controls.end()) << static_cast<int>(kind);
}

TEST(Overlays, APointerThatWasPressedInThePictureIsTheScenes) {
    Shown shown;
    EXPECT_TRUE(shown.overlay.pointer(40, 40, false));
    EXPECT_FALSE(shown.overlay.pointer(kAcross / 2, 200, false));
    EXPECT_FALSE(shown.overlay.pointer(kAcross / 2, 200, true));
    EXPECT_FALSE(shown.overlay.pointer(40, 40, true)) << "a drag that began in the picture";
    EXPECT_FALSE(shown.overlay.pointer(kAcross / 2, 200, false));
    EXPECT_TRUE(shown.overlay.wheel(1) == false) << "over the picture";
    EXPECT_TRUE(shown.overlay.pointer(40, 40, false));
    EXPECT_TRUE(shown.overlay.wheel(1));
    EXPECT_TRUE(shown.overlay.takeActions().empty());
}

OverlayContent everybodys() {
    OverlayContent all;
    all.bar = OverlayContent::Bar{"WALK", "whitted", true, false, 2, .5, true, false, false};
    all.viewpoints = {{11, "Door", true}, {12, "Roof", false}};
    return all;
}
/// The actions of clicks along the bar.
std::vector<OverlayAction> clicksAlong(Shown& shown, int y = 14) {
    std::vector<OverlayAction> all;
    for (int x = 2; x < kAcross; x += 5)
        for (const OverlayAction& action : shown.click(x, y)) all.push_back(action);
    return all;
}

TEST(Overlays, TheBarOffersWhatOneNeedsFirst) {
    Shown shown(everybodys());
    EXPECT_TRUE(shown.screen.isTouched(kAcross / 2, 4));
    EXPECT_FALSE(shown.screen.isTouched(kAcross / 2, 120)) << "it is thin";
    std::vector<OverlayAction> all = clicksAlong(shown);
    for (const OverlayAction& action : clicksAlong(shown, 40)) all.push_back(action);  // its second row
    for (const Kind kind :
         {Kind::files, Kind::back, Kind::walls, Kind::ground, Kind::speed, Kind::viewAll, Kind::straighten,
          Kind::volume, Kind::screenshot, Kind::log, Kind::film, Kind::details, Kind::keys, Kind::hideBar})
        EXPECT_TRUE(has(all, kind, 0)) << static_cast<int>(kind);
    EXPECT_FALSE(shown.overlay.pointer(kAcross / 2, 300, false)) << "the picture below is the scene's";
}

TEST(Overlays, MenusOpenBelowTheBarAndClose) {
    Shown shown(everybodys());
    std::vector<OverlayAction> chosen;
    for (int x = 2; x < kAcross; x += 18)
        for (int y = 60; y < 220; y += 9) {  // a click opens the menu that is there, and the next one closes it
            (void)shown.click(x, 14);
            for (const OverlayAction& action : shown.click(x + 4, y)) chosen.push_back(action);
        }
    EXPECT_TRUE(has(chosen, Kind::viewpoint, 12));
    const auto named = [&](Kind kind, const char* name) {
        return std::ranges::any_of(chosen, [&](const auto& a) { return a.kind == kind && a.name == name; });
    };
    EXPECT_TRUE(named(Kind::navigation, "FLY"));
    EXPECT_TRUE(named(Kind::pictures, "path"));
    (void)shown.click(kAcross / 2, 500);
    EXPECT_FALSE(shown.overlay.pointer(kAcross / 2, 100, false)) << "a click in the picture closes a menu";
}

TEST(Overlays, MessagesKeysAndFilesAreListed) {
    OverlayContent all = everybodys();
    using Level = OverlayContent::Message::Level;
    all.messages = {{Level::note, "log begun"}, {Level::error, "nothere.png: no such file"}};
    all.messageCount = 2;
    Shown line(all);
    EXPECT_TRUE(line.screen.isTouched(30, kDown - 20));
    EXPECT_FALSE(line.screen.isTouched(30, kDown - 150));
    auto clicks = [](Shown& shown, int from) {
        std::vector<OverlayAction> found;
        for (int y = from; y < kDown; y += 5)
            for (int x = 10; x < 300; x += 8)
                for (const OverlayAction& action : shown.click(x, y)) found.push_back(action);
        return found;
    };
    EXPECT_TRUE(has(clicks(line, kDown - 45), Kind::messages, 0));
    all.listsMessages = true;
    Shown list(all);
    const auto there = clicks(list, kDown - 130);
    EXPECT_TRUE(has(there, Kind::copy, 0));
    EXPECT_TRUE(has(there, Kind::forget, 0));
    all.keys = {{"F1", "figures", false, {}}};
    EXPECT_FALSE(Shown(all).screen.pixels == list.screen.pixels);
    all.keys.clear();
    all.files = OverlayContent::Files{"/home", {{"..", true}, {"hall.x3dv", false}}};
    Shown files(all);
    std::vector<OverlayAction> entries = files.clicksDown(40, 40, 200);
    EXPECT_TRUE(std::ranges::any_of(entries, [](const auto& a) { return a.kind == Kind::folder && a.name == ".."; }));
    EXPECT_TRUE(
        std::ranges::any_of(entries, [](const auto& a) { return a.kind == Kind::file && a.name == "hall.x3dv"; }));
}

TEST(Overlays, ATipStandsBesideThePointer) {
    OverlayContent all;
    all.tip = "opens the door";
    Shown shown(all);
    (void)shown.overlay.pointer(300, 200, false);
    Screen screen;
    shown.overlay.paint(screen.rows());
    EXPECT_TRUE(screen.isTouched(330, 230));
    EXPECT_FALSE(screen.isTouched(290, 190));
}

TEST(Overlays, RightToLeftLettersStandFromTheRight) {
    EXPECT_EQ(visual("plain (12)"), "plain (12)");
    EXPECT_EQ(visual("שלום"), "םולש");
    EXPECT_EQ(visual("Gate / שלום עולם 12 x"), "Gate / םלוע םולש 12 x");
    EXPECT_EQ(visual("א12ב(ג"), "ג)ב12א");
    EXPECT_EQ(visual("שָׁל"), "לשָׁ") << "marks stay with their letter";
    EXPECT_EQ(visual("\xD7"), "\xD7") << "half a letter";
    OverlayContent hebrew = everybodys(), unknown = everybodys();
    hebrew.hasDetails = unknown.hasDetails = true;
    hebrew.viewpoints[0].name = "שלום", unknown.viewpoints[0].name = "????";
    EXPECT_FALSE(Shown(hebrew).screen.pixels == Shown(unknown).screen.pixels);
    // Letters for which there is perhaps no font are drawn all the same.
    hebrew.viewpoints[0].name = "正面から", unknown.viewpoints[0].name = "";
    EXPECT_FALSE(Shown(hebrew).screen.pixels == Shown(unknown).screen.pixels);
}

TEST(Overlays, OnAFineDisplayAllIsLarger) {
    const auto rows = [](float scale) {
        Overlay overlay(scale);
        OverlayContent all = everybodys();
        all.bar->pictures.clear(), all.bar->volume.reset(), all.bar->navigation.clear();
        overlay.set(std::make_shared<const OverlayContent>(all));
        Screen screen;
        for (int i = 0; i < 3; ++i) overlay.paint(screen.rows());
        int last = 0;
        while (screen.isTouched(kAcross / 2, last)) ++last;
        return last;
    };
    EXPECT_GT(rows(2), 1.6 * rows(1));
}

TEST(Overlays, ASmallWindowAndNoContentAreDrawn) {
    Shown empty{OverlayContent{}};
    Overlay* overlay = &empty.overlay;
    Screen small;
    overlay->set(std::make_shared<const OverlayContent>(content()));
    overlay->paint({small.pixels.data(), 90, 60, 4 * kAcross});
    for (int y = 0; y < 60; ++y) EXPECT_FALSE(small.isTouched(100, y)) << "nothing beyond the window";
}

/// Both halves of a shape share an edge, on which no pixel is drawn twice and none is left out.
TEST(DrawLists, PixelsOnASharedEdgeAreDrawnOnce) {
    ImGuiContext* context = ImGui::CreateContext();
    ImGui::GetIO().IniFilename = nullptr;  // nothing is written
    unsigned char* texels = nullptr;
    Coverage atlas;
    ImGui::GetIO().Fonts->GetTexDataAsAlpha8(&texels, &atlas.width, &atlas.height);
    atlas.texels = texels;
    ImGui::GetIO().DisplaySize = ImVec2(64, 64);
    ImGui::GetIO().DeltaTime = 1;
    ImGui::GetStyle().AntiAliasedFill = false;
    ImGui::NewFrame();
    ImDrawList& list = *ImGui::GetForegroundDrawList();
    list.AddTriangleFilled(ImVec2(4, 4), ImVec2(60, 7), ImVec2(58, 61), IM_COL32(255, 255, 255, 128));
    list.AddTriangleFilled(ImVec2(4, 4), ImVec2(58, 61), ImVec2(2, 50), IM_COL32(255, 255, 255, 128));
    ImGui::Render();
    std::vector<std::uint8_t> pixels(std::size_t{4} * 64 * 64, 0);
    draw(*ImGui::GetDrawData(), atlas, {pixels.data(), 64, 64, 256});
    ImGui::DestroyContext(context);
    int once = 0;
    for (int y = 0; y < 64; ++y)
        for (int x = 0; x < 64; ++x) {
            const int value = pixels[static_cast<std::size_t>(4 * (64 * y + x))];
            EXPECT_TRUE(value == 0 || value == 128) << x << ' ' << y << ": " << value;
            once += value == 128;
        }
    EXPECT_NEAR(once, .5 * ((58 - 4) * (50 - 61) - (2 - 58) * (61 - 4) + 56 * 57 - 54 * 3), 200);
    for (int i = 8; i < 55; ++i) EXPECT_EQ(pixels[static_cast<std::size_t>(4 * (64 * i + i))], 128) << i;
}

}  // namespace
}  // namespace rtsg
#endif
