// A window by SDL 2. The processor writes its pixels, so it needs no graphics card.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <memory>
#include <mutex>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <SDL.h>

#include "../src/view/window_module.h"
#include "enlarge.h"
#ifdef RTSG_HAS_OVERLAY
#include "overlay.h"
#endif

namespace rtsg {

namespace {

class SdlWindow final : public WindowModule {
  public:
    ~SdlWindow() override {
        if (pad_) SDL_GameControllerClose(pad_);
        if (hand_) SDL_FreeCursor(hand_);
        if (arrow_) SDL_FreeCursor(arrow_);
        if (window_) {
            letWakesArrive();
            SDL_DestroyWindow(window_);
        }
        SDL_Quit();
    }

    bool open(const WindowSettings& settings, std::string& problem) {
        // SDL would take OpenGL by itself, with which a picture costs ten times as much on a machine without a graphics
        // card.
        SDL_SetHint(SDL_HINT_FRAMEBUFFER_ACCELERATION, "0");
        SDL_SetHint(SDL_HINT_VIDEO_ALLOW_SCREENSAVER, "1");
        SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");
        if (SDL_Init(SDL_INIT_VIDEO) != 0) return problem = SDL_GetError(), false;
        // Without a display SDL uses an invisible one. That is only wanted if the user asks for it.
        const std::string driver = SDL_GetCurrentVideoDriver();
        isUnseen_ = driver == "offscreen" || driver == "dummy";
        if (isUnseen_ && !SDL_getenv("SDL_VIDEODRIVER"))
            return problem = "there is no display (SDL_VIDEODRIVER=offscreen does without one)", false;
        const Uint32 flags = SDL_WINDOW_RESIZABLE | (settings.fullscreen ? Uint32{SDL_WINDOW_FULLSCREEN_DESKTOP} : 0U);
        window_ = SDL_CreateWindow(settings.title.c_str(), SDL_WINDOWPOS_CENTERED, SDL_WINDOWPOS_CENTERED,
                                   settings.width, settings.height, flags);
        if (!window_) return problem = SDL_GetError(), false;
        woken_ = SDL_RegisterEvents(1);
        SDL_StartTextInput();
        // Gamepads are looked at in next(): SDL would do so a thousand times a second, also while nothing moves.
        SDL_SetHint(SDL_HINT_AUTO_UPDATE_JOYSTICKS, "0");
        SDL_InitSubSystem(SDL_INIT_GAMECONTROLLER);  // without one there is none
        return true;
    }

    int width() const override { return size().first; }
    int height() const override { return size().second; }

    WindowEvent next(int milliseconds) override {
        SDL_Event event;
        SDL_GameControllerUpdate();
        if (SDL_PollEvent(&event)) return translated(event);
        if (milliseconds <= 0) return {};
        // A gamepad is polled as often as pictures are made.
        if (!pad_) return wait(event, milliseconds) ? translated(event) : WindowEvent{};
        for (int left = milliseconds; left > 0; left -= kPadEvery) {
            if (wait(event, std::min(left, kPadEvery))) return translated(event);
            SDL_GameControllerUpdate();
        }
        return SDL_PollEvent(&event) ? translated(event) : WindowEvent{};
    }

    bool present(const std::uint8_t* pixels, int width, int height) override {
        SDL_Surface* screen = SDL_GetWindowSurface(window_);
        if (!screen) return false;
        // Most displays take the bytes as they are.
        const bool isSame = screen->format->format == SDL_PIXELFORMAT_RGB888 && !SDL_MUSTLOCK(screen);
        if (isSame && (screen->w != width || screen->h != height))
            enlarge({pixels, width, height}, static_cast<std::uint8_t*>(screen->pixels), screen->w, screen->h,
                    screen->pitch);
        else if (!blit(pixels, width, height, *screen))
            return false;
#ifdef RTSG_HAS_OVERLAY
        if (overlay_ && screen->format->BytesPerPixel == 4)
            overlay_->paint({static_cast<std::uint8_t*>(screen->pixels), screen->w, screen->h, screen->pitch});
#endif
        return SDL_UpdateWindowSurface(window_) == 0;
    }

#ifdef RTSG_HAS_OVERLAY
    bool setOverlay(std::shared_ptr<const OverlayContent> content) override {
        if (!content) return overlay_.reset(), true;
        if (!overlay_) overlay_ = std::make_unique<Overlay>(scale());
        overlay_->setSize(width(), height());
        overlay_->set(std::move(content));
        return true;
    }
    std::vector<OverlayAction> takeActions() override {
        return overlay_ ? overlay_->takeActions() : std::vector<OverlayAction>();
    }
#else
    bool setOverlay(std::shared_ptr<const OverlayContent>) override { return false; }
    std::vector<OverlayAction> takeActions() override { return {}; }
#endif

    void setTitle(const std::string& title) override { SDL_SetWindowTitle(window_, title.c_str()); }
    void setHand(bool on) override {
        if (!hand_) hand_ = SDL_CreateSystemCursor(SDL_SYSTEM_CURSOR_HAND);
        if (!arrow_) arrow_ = SDL_CreateSystemCursor(SDL_SYSTEM_CURSOR_ARROW);
        if (SDL_Cursor* const cursor = on ? hand_ : arrow_) SDL_SetCursor(cursor);
    }
    void setClipboard(const std::string& text) override { SDL_SetClipboardText(text.c_str()); }
    void toggleFullscreen() override {
        const bool full = (SDL_GetWindowFlags(window_) & SDL_WINDOW_FULLSCREEN_DESKTOP) != 0;
        SDL_SetWindowFullscreen(window_, full ? 0U : Uint32{SDL_WINDOW_FULLSCREEN_DESKTOP});
    }
    void wake() override {
        SDL_Event event;
        std::memset(&event, 0, sizeof(event));
        event.type = woken_;
        SDL_PushEvent(&event);
        const std::scoped_lock lock(mutex_);
        isWoken_ = true;
        called_.notify_one();
    }

  private:
    static bool blit(const std::uint8_t* pixels, int width, int height, SDL_Surface& screen) {
        auto* const bytes = const_cast<std::uint8_t*>(pixels);  // SDL only reads them
        SDL_Surface* picture =
            SDL_CreateRGBSurfaceWithFormatFrom(bytes, width, height, 32, 4 * width, SDL_PIXELFORMAT_RGB888);
        if (!picture) return false;
        const int failed = screen.w == width && screen.h == height ? SDL_BlitSurface(picture, nullptr, &screen, nullptr)
                                                                   : SDL_BlitScaled(picture, nullptr, &screen, nullptr);
        SDL_FreeSurface(picture);
        return failed == 0;
    }

    /// Where nobody sees the window only wake() brings events, and SDL would look for them a thousand times a second.
    bool wait(SDL_Event& event, int milliseconds) {
        if (!isUnseen_) return SDL_WaitEventTimeout(&event, milliseconds) != 0;
        const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(milliseconds);
        for (bool isOver = false; !isOver;) {
            if (SDL_PollEvent(&event)) return true;
            std::unique_lock lock(mutex_);
            isOver = !called_.wait_until(lock, end, [this] { return isWoken_; });
            isWoken_ = false;
        }
        return SDL_PollEvent(&event) != 0;
    }

    /// With X11, wake() uses a connection of its own. A message that arrived after the window's end would be an error,
    /// which ends the process. Once the display has answered, it has read everything that was sent before.
    void letWakesArrive() {
        constexpr int kAnswers = 3;
        SDL_Rect bounds;
        for (int i = 0; i < kAnswers; ++i) (void)SDL_GetDisplayUsableBounds(0, &bounds);
    }

    std::pair<int, int> size() const {
        int width = 1, height = 1;
        SDL_GetWindowSize(window_, &width, &height);
        return {std::max(width, 1), std::max(height, 1)};
    }

    /// The buttons that are down after this event; SDL itself also reports those of later events.
    Uint32 buttonsAfter(const SDL_MouseButtonEvent& event) {
        const Uint32 one = SDL_BUTTON(event.button);
        return buttons_ = event.state == SDL_PRESSED ? buttons_ | one : buttons_ & ~one;
    }

    /// Pixels of the overlay for one on a display of 96 dots an inch.
    float scale() const {
        constexpr float kUsual = 96, kStep = .25f, kLargest = 4;
        float dots = kUsual;
        const int display = SDL_GetWindowDisplayIndex(window_);
        if (display < 0 || SDL_GetDisplayDPI(display, &dots, nullptr, nullptr) != 0) return 1;
        return std::clamp(std::round(dots / kUsual / kStep) * kStep, 1.f, kLargest);
    }

    WindowEvent pointerAt(int x, int y, Uint32 buttons) {
        WindowEvent event;
        buttons_ = buttons;
#ifdef RTSG_HAS_OVERLAY
        if (overlay_ &&
            overlay_->pointer(static_cast<float>(x), static_cast<float>(y), (buttons & SDL_BUTTON_LMASK) != 0)) {
            // The pointer has left the things of the scene that it was over.
            event.kind = std::exchange(inScene_, false) ? WindowEvent::Kind::left : WindowEvent::Kind::overlay;
            return event;
        }
#endif
        inScene_ = true;
        event.kind = WindowEvent::Kind::pointer;
        const auto [width, height] = size();
        event.x = (x + .5) / width, event.y = (y + .5) / height;
        event.buttons = (buttons & SDL_BUTTON_LMASK ? 1U : 0U) | (buttons & SDL_BUTTON_RMASK ? 2U : 0U) |
                        (buttons & SDL_BUTTON_MMASK ? 4U : 0U);
        return event;
    }

    static WindowEvent::Key keyOf(SDL_Keycode code) {
        using Key = WindowEvent::Key;
        switch (code) {
            case SDLK_ESCAPE:
                return Key::escape;
            case SDLK_RETURN:
            case SDLK_KP_ENTER:
                return Key::enter;
            case SDLK_BACKSPACE:
                return Key::backspace;
            case SDLK_TAB:
                return Key::tab;
            case SDLK_SPACE:
                return Key::space;
            case SDLK_HOME:
                return Key::home;
            case SDLK_END:
                return Key::end;
            case SDLK_PAGEUP:
                return Key::pageUp;
            case SDLK_PAGEDOWN:
                return Key::pageDown;
            case SDLK_UP:
                return Key::up;
            case SDLK_DOWN:
                return Key::down;
            case SDLK_LEFT:
                return Key::left;
            case SDLK_RIGHT:
                return Key::right;
            case SDLK_LSHIFT:
            case SDLK_RSHIFT:
                return Key::shift;
            case SDLK_LCTRL:
            case SDLK_RCTRL:
                return Key::control;
            case SDLK_LALT:
            case SDLK_RALT:
                return Key::alt;
            default:
                return Key::none;
        }
    }

    static WindowEvent keyEvent(const SDL_KeyboardEvent& from) {
        WindowEvent event;
        event.kind = WindowEvent::Kind::key;
        event.down = from.state == SDL_PRESSED;
        event.repeats = from.repeat != 0;
        event.control = (from.keysym.mod & KMOD_CTRL) != 0;
        event.alt = (from.keysym.mod & KMOD_ALT) != 0;
        const SDL_Keycode code = from.keysym.sym;
        event.key = keyOf(code);
        if (code >= SDLK_F1 && code <= SDLK_F12) event.functionKey = static_cast<int>(code - SDLK_F1) + 1;
        if (event.key == WindowEvent::Key::none && code > 32 && code < 0x110000)
            event.character = static_cast<char32_t>(code);
        // A Cyrillic or Greek layout has no Latin letters: then the key counts that has one elsewhere.
        constexpr char32_t kLastOfAscii = 0x7F;
        if (const SDL_Scancode at = from.keysym.scancode;
            event.control && event.character > kLastOfAscii && at >= SDL_SCANCODE_A && at <= SDL_SCANCODE_Z)
            event.character = U'a' + static_cast<char32_t>(at - SDL_SCANCODE_A);
        return event;
    }

    WindowEvent translated(const SDL_Event& from) {
        using Kind = WindowEvent::Kind;
        WindowEvent event;
        event.kind = Kind::other;
        if (from.type == woken_) event.kind = Kind::woken;
        switch (from.type) {
            case SDL_QUIT:
                event.kind = Kind::close;
                break;
            case SDL_WINDOWEVENT:
                return windowEvent(from.window);
            case SDL_KEYDOWN:
            case SDL_KEYUP:
                return keyEvent(from.key);
            case SDL_TEXTINPUT:
                event.kind = Kind::text;
                event.text = from.text.text;
                break;
            case SDL_MOUSEMOTION:
                return pointerAt(from.motion.x, from.motion.y, from.motion.state);
            case SDL_MOUSEBUTTONDOWN:
            case SDL_MOUSEBUTTONUP:
                return pointerAt(from.button.x, from.button.y, buttonsAfter(from.button));
            case SDL_MOUSEWHEEL:
#ifdef RTSG_HAS_OVERLAY
                if (overlay_ && overlay_->wheel(-from.wheel.preciseY)) {
                    event.kind = Kind::overlay;
                    break;
                }
#endif
                event.kind = Kind::wheel;
                event.across = from.wheel.preciseX, event.downwards = -from.wheel.preciseY;
                break;
            case SDL_DROPFILE:
                event.kind = Kind::dropped;
                event.text = from.drop.file;
                SDL_free(from.drop.file);
                break;
            case SDL_CONTROLLERDEVICEADDED:
                if (!pad_) pad_ = SDL_GameControllerOpen(from.cdevice.which);
                break;
            case SDL_CONTROLLERDEVICEREMOVED:
                return padRemoved(from.cdevice.which);
            case SDL_CONTROLLERAXISMOTION:
                return sticks();
            case SDL_CONTROLLERBUTTONDOWN:
            case SDL_CONTROLLERBUTTONUP:
                return padButton(from.cbutton);
            default:
                break;
        }
        return event;
    }

    // ---- gamepads ----------------------------------------------------------------------------------------------
    static constexpr int kPadEvery = 16;    // ms
    static constexpr double kMiddle = .15;  // of a stick's way: that near to the middle it rests
    double stick(SDL_GameControllerAxis axis) const {
        const double at = std::clamp(SDL_GameControllerGetAxis(pad_, axis) / 32767., -1., 1.);
        const double distance = std::abs(at) - kMiddle;
        return distance <= 0 ? 0 : std::copysign(distance / (1 - kMiddle), at);
    }
    WindowEvent sticks() const {
        WindowEvent event;
        event.kind = WindowEvent::Kind::sticks;
        event.leftX = stick(SDL_CONTROLLER_AXIS_LEFTX), event.leftY = stick(SDL_CONTROLLER_AXIS_LEFTY);
        event.rightX = stick(SDL_CONTROLLER_AXIS_RIGHTX), event.rightY = stick(SDL_CONTROLLER_AXIS_RIGHTY);
        return event;
    }
    /// All sticks are in the middle then.
    WindowEvent padRemoved(SDL_JoystickID which) {
        WindowEvent event;
        event.kind = WindowEvent::Kind::other;
        if (!pad_ || SDL_JoystickInstanceID(SDL_GameControllerGetJoystick(pad_)) != which) return event;
        SDL_GameControllerClose(std::exchange(pad_, nullptr));
        event.kind = WindowEvent::Kind::sticks;
        return event;
    }
    static WindowEvent padButton(const SDL_ControllerButtonEvent& from) {
        using Button = WindowEvent::PadButton;
        WindowEvent event;
        event.kind = WindowEvent::Kind::button;
        event.down = from.state == SDL_PRESSED;
        switch (from.button) {
            case SDL_CONTROLLER_BUTTON_LEFTSHOULDER:
                event.padButton = Button::leftShoulder;
                break;
            case SDL_CONTROLLER_BUTTON_RIGHTSHOULDER:
                event.padButton = Button::rightShoulder;
                break;
            case SDL_CONTROLLER_BUTTON_START:
                event.padButton = Button::start;
                break;
            case SDL_CONTROLLER_BUTTON_BACK:
                event.padButton = Button::back;
                break;
            default:
                break;
        }
        return event;
    }

    WindowEvent windowEvent(const SDL_WindowEvent& from) {
        using Kind = WindowEvent::Kind;
        WindowEvent event;
        event.kind = Kind::other;
        switch (from.event) {
            case SDL_WINDOWEVENT_CLOSE:
                event.kind = Kind::close;
                break;
            case SDL_WINDOWEVENT_EXPOSED:
                event.kind = Kind::exposed;
                break;
            case SDL_WINDOWEVENT_MINIMIZED:
            case SDL_WINDOWEVENT_HIDDEN:
            case SDL_WINDOWEVENT_SHOWN:
            case SDL_WINDOWEVENT_RESTORED:
            case SDL_WINDOWEVENT_MAXIMIZED:
                event.kind = Kind::seen;
                event.down = from.event != SDL_WINDOWEVENT_MINIMIZED && from.event != SDL_WINDOWEVENT_HIDDEN;
                break;
            case SDL_WINDOWEVENT_LEAVE:
#ifdef RTSG_HAS_OVERLAY
                if (overlay_) overlay_->pointerLeft();
#endif
                event.kind = Kind::left;
                break;
            case SDL_WINDOWEVENT_SIZE_CHANGED:
                event.kind = Kind::resized;
                std::tie(event.width, event.height) = size();
                break;
            default:
                break;
        }
        return event;
    }

    SDL_Window* window_ = nullptr;
    SDL_GameController* pad_ = nullptr;  // the first that came
    Uint32 woken_ = 0, buttons_ = 0;
    bool isUnseen_ = false;
    std::mutex mutex_;
    std::condition_variable called_;
    bool isWoken_ = false;  // guarded by mutex_
    bool inScene_ = false;  // the pointer, as was told last
    SDL_Cursor *hand_ = nullptr, *arrow_ = nullptr;
#ifdef RTSG_HAS_OVERLAY
    std::unique_ptr<Overlay> overlay_;
#endif
};

std::unique_ptr<WindowModule> openWindow(const WindowSettings& settings, std::string& problem) {
    auto window = std::make_unique<SdlWindow>();
    if (!window->open(settings, problem)) return nullptr;
    return window;
}

}  // namespace

}  // namespace rtsg

extern "C" __attribute__((visibility("default"))) rtsg::OpenWindow rtsg_open_window_3() {
    return &rtsg::openWindow;
}
