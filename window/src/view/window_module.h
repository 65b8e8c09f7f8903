// The interface of librtsg_sdl.so: a window and its events, by a library that only the module links.
//
// Invariant: this header does not mention SDL, and the module does not link this library. Errors are sentences.
// Threading: all calls on the thread that opened the window, but wake(), which any may make.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "overlay_content.h"

namespace rtsg {

struct WindowSettings {
    std::string title;
    int width = 1280, height = 720;
    bool fullscreen = false;
};

/// Something that happened to a window.
struct WindowEvent {
    enum class Kind : std::uint8_t {
        none,     // nothing has come in time
        other,    // events of no interest
        close,    // it is to be closed
        woken,    // wake() was called
        exposed,  // its content is lost: present() is due
        resized,  // width, height: its new size
        seen,     // down: it can be seen now; else nobody sees it, as it is minimised or hidden
        key,      // down, key, repeats; modifiers as they are then
        text,     // typed or composed text
        pointer,  // x, y, buttons as they are now
        left,     // the pointer has left the window
        wheel,    // across, down: steps
        dropped,  // text: a file
        sticks,   // of a gamepad: leftX and so on, as they are now
        button,   // of a gamepad: down, padButton
        overlay,  // it was for the overlay: present() is due
    };
    /// Buttons of a gamepad. Sticks are 0 in the middle and in a zone around it, 1 at the right and at the bottom.
    enum class PadButton : std::uint8_t { none, leftShoulder, rightShoulder, start, back };
    /// Keys without text. Others are named by the character that they write without modifiers, in `character`. With
    /// Control it is the Latin letter at that place of the keyboard, where the layout has other letters.
    enum class Key : std::uint8_t {
        none,
        escape,
        enter,
        backspace,
        tab,
        space,
        home,
        end,
        pageUp,
        pageDown,
        up,
        down,
        left,
        right,
        shift,
        control,
        alt,
        f1
    };
    Kind kind = Kind::none;
    int width = 0, height = 0;
    bool down = false, repeats = false, control = false, alt = false;
    Key key = Key::none;
    int functionKey = 0;        // 1 to 12, or 0
    char32_t character = 0;     // lower case, or 0
    double x = 0, y = 0;        // of 1, from the left and the top
    std::uint32_t buttons = 0;  // 1: the first one
    double across = 0, downwards = 0;
    double leftX = 0, leftY = 0, rightX = 0, rightY = 0;
    PadButton padButton = PadButton::none;
    std::string text;
};

class WindowModule {
  public:
    virtual ~WindowModule() = default;
    virtual int width() const = 0;
    virtual int height() const = 0;
    /// The next event; waits for one at most so many milliseconds (0: not at all).
    virtual WindowEvent next(int milliseconds) = 0;
    /// Fills the window with a picture: `pixels` are B, G, R, X, row by row from the top, enlarged as needed. False:
    /// the display refused.
    virtual bool present(const std::uint8_t* pixels, int width, int height) = 0;
    /// Sets the overlay that present() draws from now on; null: none. Returns false if the module was built without
    /// overlay.
    virtual bool setOverlay(std::shared_ptr<const OverlayContent> content) = 0;
    /// The users' actions in the overlay since the last call.
    virtual std::vector<OverlayAction> takeActions() = 0;
    virtual void setTitle(const std::string& title) = 0;
    /// Whether the pointer is over something that a click does something to.
    virtual void setHand(bool on) = 0;
    virtual void setClipboard(const std::string& text) = 0;
    virtual void toggleFullscreen() = 0;
    virtual void wake() = 0;
};

/// Null, and why.
using OpenWindow = std::unique_ptr<WindowModule> (*)(const WindowSettings&, std::string& problem);
/// The one symbol of the module: a function without arguments that returns an OpenWindow.
#define RTSG_WINDOW_SYMBOL "rtsg_open_window_3"

}  // namespace rtsg
