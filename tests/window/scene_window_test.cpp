// A window that nobody sees, with the events of SDL: keys of its own, the overlay, a gamepad.
#ifdef RTSG_HAS_SDL
#include <array>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <set>
#include <thread>

#include <SDL.h>
#include <gtest/gtest.h>

#include <rtsg/core/navigation.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/world_queries.h>
#include <rtsg/window/scene_window.h>

#include "test_paths.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using Request = SceneWindowRequest::Kind;

const char* const kRoom = R"(#X3D V4.0 utf8
PROFILE Immersive
NavigationInfo { type "WALK" speed 2 }
Viewpoint { position 0 1.6 6 description "near" }
DEF FAR Viewpoint { position 0 1.6 30 description "far" }
DEF BOX Transform { translation 0 1.6 0 children DEF LEAF Shape { geometry Box { } } }
Transform { translation 0 -.05 0 children Shape { geometry Box { size 90 .1 90 } } }
)";

class AWindow : public testing::Test {
  protected:
    AWindow() {
        ::setenv("SDL_VIDEODRIVER", "offscreen", 1);
        ::setenv("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1", 1);  // nobody gives a window without a screen the focus
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene, kRoom, diagnostics));
        scene.setNavigation(true);
        scene.newFrame(0);
        world.emplace(scene);
    }
    ~AWindow() override { ::unsetenv("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS"); }
    void open(SceneWindowOptions options = {}) {
        options.picture.settings.width = 320, options.picture.settings.height = 200;
        options.picture.settings.threads = 1;
        auto opened = SceneWindow::open(*world, std::move(options));
        ASSERT_TRUE(opened) << opened.error().text;
        window = std::move(*opened);
    }
    /// Frames at a sixtieth, until it is as asked.
    template <class Wanted>
    bool run(const Wanted& wanted, int frames = 2000) {
        for (int i = 0; i < frames; ++i) {
            scene.newFrame(time += 1 / 60.0);
            if (!window->poll(4ms)) return false;
            if (wanted()) return true;
        }
        return false;
    }
    static void key(SDL_Keycode code, Uint16 modifiers = 0) {
        for (const Uint32 type : {Uint32{SDL_KEYDOWN}, Uint32{SDL_KEYUP}}) {
            SDL_Event event{};
            event.type = type;
            event.key.state = type == SDL_KEYDOWN ? SDL_PRESSED : SDL_RELEASED;
            event.key.keysym.sym = code;
            event.key.keysym.mod = modifiers;
            SDL_PushEvent(&event);
        }
    }
    static void button(int x, int y, bool down) {
        SDL_Event event{};
        event.type = down ? SDL_MOUSEBUTTONDOWN : SDL_MOUSEBUTTONUP;
        event.button.button = SDL_BUTTON_LEFT;
        event.button.state = down ? SDL_PRESSED : SDL_RELEASED;
        event.button.x = x, event.button.y = y;
        SDL_PushEvent(&event);
    }

    Scene scene;
    std::optional<SharedWorld> world;
    std::unique_ptr<SceneWindow> window;
    double time = 0;
};

TEST_F(AWindow, KeysOfItsOwnAskTheApplication) {
    open();
    key(SDLK_SPACE, KMOD_LCTRL);
    key(SDLK_RIGHT, KMOD_LCTRL);
    key(SDLK_l, KMOD_LCTRL);
    key(SDLK_f, KMOD_LCTRL);
    std::vector<Request> kinds;
    EXPECT_TRUE(run([&] {
        for (const auto& request : window->takeRequests()) kinds.push_back(request.kind);
        return kinds.size() >= 4;
    }));
    EXPECT_EQ(kinds, (std::vector{Request::pause, Request::skip, Request::log, Request::film}));
    EXPECT_TRUE(window->isPaused());
    window->setPaused(false);
    EXPECT_FALSE(window->isPaused());
    key(SDLK_ESCAPE);
    EXPECT_FALSE(run([] { return false; }, 50)) << "it is closed";
}

TEST_F(AWindow, AGamepadsSticksMoveTheViewerAndTheirMiddleDoesNot) {
    open();
    if (!run([] { return SDL_WasInit(SDL_INIT_GAMECONTROLLER) != 0; }, 10)) GTEST_SKIP() << "SDL has no gamepads here";
    const int device = SDL_JoystickAttachVirtual(SDL_JOYSTICK_TYPE_GAMECONTROLLER, SDL_CONTROLLER_AXIS_MAX,
                                                 SDL_CONTROLLER_BUTTON_MAX, 0);
    ASSERT_GE(device, 0) << SDL_GetError();
    SDL_Joystick* pad = SDL_JoystickOpen(device);
    ASSERT_TRUE(pad);
    (void)run([] { return false; }, 30);  // it is found
    const ViewerPose before = viewerPose(scene);
    SDL_JoystickSetVirtualAxis(pad, SDL_CONTROLLER_AXIS_LEFTY,
                               3000);  // a stick that rests is never quite in the middle
    (void)run([] { return false; }, 20);
    EXPECT_EQ(viewerPose(scene), before);
    SDL_JoystickSetVirtualAxis(pad, SDL_CONTROLLER_AXIS_LEFTY, -32768);
    EXPECT_TRUE(run([&] { return viewerPose(scene).position.z < before.position.z - 1; })) << "ahead";
    SDL_JoystickSetVirtualAxis(pad, SDL_CONTROLLER_AXIS_LEFTY, 0);
    SDL_JoystickSetVirtualAxis(pad, SDL_CONTROLLER_AXIS_RIGHTX, 32767);
    EXPECT_TRUE(run([&] {
        const Vec3d ahead = viewerPose(scene).orientation * Vec3d(0, 0, -1);
        return ahead.x > .3;
    })) << "turned to the right";
    SDL_JoystickSetVirtualAxis(pad, SDL_CONTROLLER_AXIS_RIGHTX, 0);
    (void)run([] { return false; }, 20);
    const ViewerPose rests = viewerPose(scene);
    (void)run([] { return false; }, 20);
    EXPECT_EQ(viewerPose(scene), rests);
    SDL_JoystickSetVirtualButton(pad, SDL_CONTROLLER_BUTTON_RIGHTSHOULDER, SDL_PRESSED);
    EXPECT_TRUE(run([&] { return viewerPose(scene).position.z > 25; })) << "the next viewpoint";
    // One that is pulled out lets go of its sticks.
    SDL_JoystickSetVirtualAxis(pad, SDL_CONTROLLER_AXIS_LEFTY, -32768);
    EXPECT_TRUE(run([&] { return viewerPose(scene).position.z < 29.5; }));
    SDL_JoystickClose(pad);
    SDL_JoystickDetachVirtual(device);
    (void)run([] { return false; }, 30);
    const ViewerPose left = viewerPose(scene);
    (void)run([] { return false; }, 30);
    EXPECT_EQ(viewerPose(scene), left);
}

TEST_F(AWindow, TheOverlayTakesWhatIsClickedInItsPanels) {
    int looked = 0;
    SceneWindowOptions options;
    options.look = [&](NodeId viewpoint) -> Result<> {
        looked += scene.name(viewpoint) == "FAR";
        return {};
    };
    open(std::move(options));
    EXPECT_FALSE(window->showsOverlay());
    key(SDLK_F1);
    ASSERT_TRUE(run([&] { return window->statistics().presented > 0 && window->statistics().events == 0; }));
    if (!window->showsOverlay()) GTEST_SKIP() << "built without overlay";
    (void)run([] { return false; }, 60);
    for (int y = 10; y < 190 && looked == 0; y += 3) {
        button(60, y, true), button(60, y, false);
        (void)run([] { return false; }, 2);
    }
    EXPECT_GT(looked, 0) << "the viewpoint's line was met";
    key(SDLK_F1);
    EXPECT_TRUE(run([&] { return !window->showsOverlay(); }));
}

/// Text that is fixed to the eye, by a ProximitySensor and by a layer: it stays at its place in the picture while
/// somebody walks and turns, and a click there is a click on it.
TEST(AHeadUpDisplay, AnswersWhereItIsSeenAfterAWalk) {
    ::setenv("SDL_VIDEODRIVER", "offscreen", 1);
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadFile(scene, RTSG_SOURCE_DIR "/examples/hud.x3dv", diagnostics));
    ASSERT_EQ(diagnostics.errors(), 0u);
    scene.setNavigation(true);
    double time = 0;
    scene.newFrame(time);
    SharedWorld world(scene);
    WorldQueries queries(world);
    scene.setSpaceQueries(&queries);
    SceneWindowOptions options;
    options.picture.settings.width = 320, options.picture.settings.height = 200;
    options.picture.settings.threads = 1;
    auto window = SceneWindow::open(world, std::move(options));
    ASSERT_TRUE(window) << window.error().text;
    const auto frames = [&](int count) {
        for (int i = 0; i < count; ++i) {
            scene.newFrame(time += 1 / 60.0);
            ASSERT_TRUE((*window)->poll(1ms));
        }
    };
    const auto push = [](Uint32 type, int x, int y) {
        SDL_Event event{};
        event.type = type;
        event.button.button = SDL_BUTTON_LEFT;
        event.button.state = type == SDL_MOUSEBUTTONDOWN ? SDL_PRESSED : SDL_RELEASED;
        event.button.x = x, event.button.y = y;
        SDL_PushEvent(&event);
    };
    const auto hold = [&](const char* name, int count) {
        ASSERT_TRUE(sendKey(scene, *KeyInput::named(name, true)));
        frames(count);
        ASSERT_TRUE(sendKey(scene, *KeyInput::named(name, false)));
        frames(3);
    };
    const auto isOn = [&] { return scene.node(scene.findName("LAMP")).get(x3d::PointLight::on); };
    const auto bound = [&] {
        const bool above = scene.node(scene.findName("ABOVE")).get(x3d::Viewpoint::isBound);
        return std::string(above ? "ABOVE" : "START");
    };
    // Of the picture's half height, at distance 1.
    const double half = std::tan(.7854 / 2);
    const auto across = [&](double x) { return static_cast<int>(160 + x / half * 100); };
    const int y = static_cast<int>(100 + .26 / half * 100);
    ASSERT_TRUE(isOn());
    for (int i = 0; i < 2; ++i) {
        push(SDL_MOUSEBUTTONDOWN, across(-.38), y), frames(3);
        push(SDL_MOUSEBUTTONUP, across(-.38), y), frames(3);
        EXPECT_EQ(isOn(), i == 1) << "the lamp, the " << i + 1 << ". time";
        hold("UP", 40);
        hold("LEFT", 30);
    }
    const ViewerPose walked = viewerPose(scene);
    EXPECT_LT(walked.position.z, 7);
    EXPECT_EQ(bound(), "START");
    push(SDL_MOUSEBUTTONDOWN, across(.38), y), frames(3);
    EXPECT_EQ(bound(), "ABOVE") << "by the layer";
    push(SDL_MOUSEBUTTONUP, across(.38), y), frames(90);  // it takes a second to get there
    EXPECT_EQ(bound(), "START");
    EXPECT_LT(glm::length(viewerPose(scene).position - walked.position), .01) << "back where somebody had walked";
    push(SDL_MOUSEBUTTONDOWN, 160, 100), frames(3);
    push(SDL_MOUSEBUTTONUP, 160, 100), frames(3);
    EXPECT_TRUE(isOn()) << "elsewhere nothing happens";
    EXPECT_EQ(bound(), "START");
    scene.setSpaceQueries(nullptr);
}

TEST_F(AWindow, AFileThatIsDroppedIsTheApplications) {
    open();
    for (const char* name : {"/somewhere/one.x3dv", "/somewhere/two words.wrl"}) {
        SDL_Event event{};
        event.type = SDL_DROPFILE;
        event.drop.file = SDL_strdup(name);
        SDL_PushEvent(&event);
    }
    std::vector<std::string> dropped;
    EXPECT_TRUE(run([&] {
        for (std::string& name : window->takeDropped()) dropped.push_back(std::move(name));
        return dropped.size() == 2;
    }));
    EXPECT_EQ(dropped, (std::vector<std::string>{"/somewhere/one.x3dv", "/somewhere/two words.wrl"}));
    EXPECT_TRUE(window->takeDropped().empty());
}

/// Ctrl+S of a Russian keyboard, whose key writes another letter.
TEST_F(AWindow, KeysCountByTheirPositionWhereTheLayoutHasNoLatinLetters) {
    open();
    constexpr SDL_Keycode kOther = 0x444;
    for (const SDL_Scancode at : {SDL_SCANCODE_L, SDL_SCANCODE_F}) {
        SDL_Event event{};
        event.type = SDL_KEYDOWN;
        event.key.state = SDL_PRESSED;
        event.key.keysym.sym = kOther;
        event.key.keysym.scancode = at;
        event.key.keysym.mod = KMOD_LCTRL;
        SDL_PushEvent(&event);
    }
    key(SDLK_l, KMOD_LCTRL);  // a Latin layout counts by what is written on its keys
    std::vector<Request> kinds;
    EXPECT_TRUE(run([&] {
        for (const auto& request : window->takeRequests()) kinds.push_back(request.kind);
        return kinds.size() >= 3;
    }));
    EXPECT_EQ(kinds, (std::vector{Request::log, Request::film, Request::log}));
}

void send(SDL_WindowEventID what) {
    SDL_Event event{};
    event.type = SDL_WINDOWEVENT;
    event.window.event = static_cast<Uint8>(what);
    SDL_PushEvent(&event);
}

TEST_F(AWindow, WhatNobodySeesIsNotDrawn) {
    open();
    ASSERT_TRUE(run([&] { return window->isSettled(); }));
    send(SDL_WINDOWEVENT_MINIMIZED);
    const auto box = scene.findName("BOX");
    const auto shake = [&](int frames) {
        for (int i = 0; i < frames; ++i) {
            ASSERT_TRUE(scene.set(box, x3d::Transform::translation, Vec3f(.01f * static_cast<float>(i), 1.6f, 0)));
            scene.newFrame(time += 1 / 60.0);
            ASSERT_TRUE(window->poll(4ms));
        }
    };
    // One that was begun may still come.
    auto before = window->statistics();
    for (int i = 0, same = 0; i < 100 && same < 3; ++i) {
        shake(10);
        const auto now = window->statistics();
        same = now.pictures.moving == before.pictures.moving && now.presented == before.presented ? same + 1 : 0;
        before = now;
    }
    shake(60);
    const auto after = window->statistics();
    EXPECT_EQ(after.pictures.moving, before.pictures.moving);
    EXPECT_EQ(after.presented, before.presented);
    send(SDL_WINDOWEVENT_RESTORED);
    EXPECT_TRUE(run([&] { return window->isSettled() && window->shown()->sequence == scene.sequence(); }));
}

TEST_F(AWindow, MessagesAreKeptAndCopied) {
    SceneWindowOptions options;
    options.bar = true;
    open(std::move(options));
    EXPECT_TRUE(window->messages().empty());
    window->showMessage({Severity::warning, "a.x3dv", {3, 1}, "ImageTexture shows no picture"});
    key(SDLK_F3);
    (void)run([] { return false; }, 10);
    ASSERT_EQ(window->messages().size(), 1u);
    SDL_SetClipboardText("nothing");
    std::string copied = "nothing";
    for (int y = 80; y < 190 && copied == "nothing"; y += 6)
        for (int x = 152; x < 177 && copied == "nothing"; x += 8) {  // right of what hides the list
            button(x, y, true), button(x, y, false);
            (void)run([] { return false; }, 2);
            if (window->messages().empty())
                window->showMessage({Severity::warning, "a.x3dv", {3, 1}, "shows no picture"});
            char* const text = SDL_GetClipboardText();
            copied = text;
            SDL_free(text);
        }
    EXPECT_NE(copied.find("a.x3dv:3:1: warning: "), std::string::npos) << copied;
}

TEST_F(AWindow, TheBarAsksTheApplication) {
    SceneWindowOptions options;
    options.bar = true;
    options.screenshots = ::testing::TempDir() + "bar-%d.png";
    open(std::move(options));
    EXPECT_TRUE(window->showsBar());
    (void)run([] { return false; }, 10);
    std::set<Request> kinds;
    for (int y = 12; y < 120; y += 23)
        for (int x = 3; x < 318; x += 6) {
            if (!window->showsBar()) key(SDLK_F2);
            button(x, y, true), button(x, y, false);
            (void)run([] { return false; }, 2);
            for (const auto& request : window->takeRequests()) kinds.insert(request.kind);
        }
    for (const Request kind : {Request::walls, Request::ground, Request::speed, Request::viewAll, Request::straighten})
        EXPECT_TRUE(kinds.contains(kind)) << static_cast<int>(kind);
    if (!window->showsBar()) key(SDLK_F2);
    EXPECT_TRUE(run([&] { return window->showsBar(); }));
    key(SDLK_F2);
    EXPECT_TRUE(run([&] { return !window->showsBar(); })) << "a key hides it";
    key(SDLK_F7);
    std::vector<SceneWindowRequest> asked;
    EXPECT_TRUE(run([&] {
        for (auto& request : window->takeRequests()) asked.push_back(std::move(request));
        return !asked.empty();
    }));
    EXPECT_EQ(asked.back().kind, Request::walls);
    EXPECT_FALSE(asked.back().on);
}

/// What a click would do, and an Anchor that leads out of the scene.
TEST_F(AWindow, AnAnchorIsAskedForWhenItIsClicked) {
    const auto shape = scene.findName("LEAF");
    const NodeId anchor = scene.createNode(x3d::Anchor::type);
    ASSERT_TRUE(scene.set(anchor, x3d::Anchor::url, Array<String>{String("other.x3dv")}));
    ASSERT_TRUE(scene.set(anchor, x3d::Anchor::description, String("to the other scene")));
    ASSERT_TRUE(scene.set(anchor, x3d::Anchor::children, Array<NodeId>{shape}));
    ASSERT_TRUE(scene.set(scene.findName("BOX"), x3d::Transform::children, Array<NodeId>{anchor}));
    WorldQueries queries(*world);
    scene.setSpaceQueries(&queries);
    open();
    std::vector<SceneWindowRequest> asked;
    const auto take = [&] {
        for (auto& request : window->takeRequests()) asked.push_back(std::move(request));
        return !asked.empty();
    };
    button(20, 20, true), button(20, 20, false);
    (void)run([] { return false; }, 10);
    EXPECT_FALSE(take()) << "beside it";
    button(160, 100, true), button(220, 100, false);
    (void)run([] { return false; }, 10);
    EXPECT_FALSE(take()) << "a drag";
    button(160, 100, true), button(160, 100, false);
    EXPECT_TRUE(run(take));
    ASSERT_FALSE(asked.empty());
    EXPECT_EQ(asked.back().kind, Request::anchor);
    EXPECT_EQ(asked.back().node, anchor);
    scene.setSpaceQueries(nullptr);
}

TEST_F(AWindow, DiagnosticsOfPicturesComeToTheApplication) {
    Diagnostics diagnostics;
    ASSERT_TRUE(
        loadText(scene,
                 "#X3D V4.0 utf8\nPROFILE Immersive\nShape { appearance Appearance { texture ImageTexture { url "
                 "\"nothere.png\" } } geometry Box { } }",
                 diagnostics));
    scene.newFrame(time += 1);
    open();
    std::string said;
    EXPECT_TRUE(run([&] {
        const Diagnostics taken = window->takeDiagnostics();
        for (const Diagnostic& d : taken.all()) said += d.text;
        return said.find("ImageTexture shows no picture") != std::string::npos;
    })) << said;
}

TEST_F(AWindow, AnotherSizeIsThatOfItsPictures) {
    open();
    ASSERT_TRUE(run([&] { return window->isSettled(); }));
    SDL_Window* own = nullptr;
    for (Uint32 id = 1; id < 1000 && !own; ++id) own = SDL_GetWindowFromID(id);
    ASSERT_NE(own, nullptr);
    SDL_SetWindowSize(own, 200, 160);
    EXPECT_TRUE(run([&] { return window->size() == std::pair(200, 160); }));
    EXPECT_TRUE(run([&] { return window->shown()->whole && window->shown()->width == 200; }));
    EXPECT_EQ(window->shown()->height, 160);
}

TEST_F(AWindow, WakeEndsATurnFromAnotherThread) {
    open();
    ASSERT_TRUE(run([&] { return window->isSettled(); }));
    for (int i = 0; i < 20; ++i) {
        std::thread other([&] { window->wake(); });
        const auto begun = std::chrono::steady_clock::now();
        EXPECT_TRUE(window->poll(60s));
        EXPECT_LT(std::chrono::steady_clock::now() - begun, 30s);
        other.join();
    }
}

/// Red, green and blue of the middle of the window.
std::array<int, 3> middleOfTheWindow() {
    for (Uint32 id = 1; id < 100; ++id) {
        SDL_Window* const open = SDL_GetWindowFromID(id);
        if (!open) continue;
        SDL_Surface* const surface = SDL_GetWindowSurface(open);
        const auto* const row = static_cast<const Uint8*>(surface->pixels) + surface->h / 2 * surface->pitch;
        Uint8 red = 0, green = 0, blue = 0;
        SDL_GetRGB(reinterpret_cast<const Uint32*>(row)[surface->w / 2], surface->format, &red, &green, &blue);
        return {red, green, blue};
    }
    return {};
}

TEST_F(AWindow, AHandIsADotWhereItIsSeen) {
    open();
    ASSERT_TRUE(run([&] { return window->isSettled(); }));
    const auto before = middleOfTheWindow();
    window->showProbe(Vec3d(0, 1.6, 1), false);  // in the middle of the picture
    ASSERT_TRUE(window->poll(4ms));
    EXPECT_EQ(middleOfTheWindow(), (std::array{160, 224, 255}));
    window->showProbe(Vec3d(0, 1.6, 1), true);
    ASSERT_TRUE(window->poll(4ms));
    EXPECT_EQ(middleOfTheWindow(), (std::array{255, 128, 32})) << "it touches";
    for (const auto& elsewhere :
         {std::optional(Vec3d(1, 1.6, 1)), std::optional(Vec3d(0, 1.6, 20)), std::optional<Vec3d>()}) {
        window->showProbe(elsewhere, true);  // aside, behind the eye, nowhere
        ASSERT_TRUE(window->poll(4ms));
        EXPECT_EQ(middleOfTheWindow(), before);
    }
}

}  // namespace
}  // namespace rtsg
#endif
