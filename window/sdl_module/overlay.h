// The overlay: figures, viewpoints, the tree of nodes, what is picked, and a log's time line, drawn over the picture by
// Dear ImGui.
//
// Its panels lie at fixed places. A pointer that is over one, or was pressed there, is the overlay's; every other one
// is the scene's. Invariant: nothing changes and nothing is drawn but in the calls below. Threading: one thread; one
// object at a time, as ImGui's context is the process's.
#pragma once

#include <chrono>
#include <memory>
#include <utility>
#include <vector>

#include "../src/view/overlay_content.h"
#include "draw_list.h"
#include "overlay_fonts.h"

namespace rtsg {

class Overlay {
  public:
    /// `scale`: pixels for one on a usual display.
    explicit Overlay(float scale = 1);
    ~Overlay();
    Overlay(const Overlay&) = delete;
    Overlay& operator=(const Overlay&) = delete;

    void set(std::shared_ptr<const OverlayContent> content);
    /// The size of the window in pixels.
    void setSize(int width, int height);
    /// True: it is for the overlay. Places in pixels from the left and the top; `down`: the first button is.
    bool pointer(float x, float y, bool down);
    void pointerLeft();
    /// The same, at the pointer's place: steps down.
    bool wheel(float down);
    void paint(const PixelRows& target);
    std::vector<OverlayAction> takeActions() { return std::exchange(actions_, {}); }

  private:
    struct Box {
        float x = 0, y = 0, width = 0, height = 0;
        bool holds(float px, float py) const { return px >= x && px < x + width && py >= y && py < y + height; }
    };
    void style();
    void makeFonts();
    void frame();
    void details();
    void bar();
    void barItems();
    bool item(const std::string& label, bool isOn = false);
    bool menuItem(const char* name, const std::string& label);
    void menu();
    void messages();
    void keys();
    void files();
    void tip();
    bool begin(const char* name, const Box& box);
    void figures();
    void lines(const char* name, const std::vector<OverlayContent::Line>& all);
    void curve();
    void viewpoints();
    void tree();
    void row(const OverlayContent::Row& row);
    void picked();
    void timeline();
    void controls(const OverlayContent::Timeline& line);
    void track(const OverlayContent::Timeline& line);
    bool icon(const char* name, int shape);
    void act(OverlayAction::Kind kind, std::uint32_t node = 0, double number = 0, std::string name = {}) {
        actions_.push_back({kind, node, number, std::move(name)});
    }

    ImGuiContext* context_;
    Coverage atlas_;
    std::shared_ptr<const OverlayContent> content_;
    std::vector<OverlayAction> actions_;
    const float scale_;
    OverlayFonts fonts_;
    std::vector<Box> panels_;  // of the last frame
    std::string menu_;         // the one that is open below the bar
    bool menuIsNew_ = false, isFirstItem_ = true;
    float menuAt_ = 0, barHeight_ = 0, below_ = 0;  // the bar's, and of what lies at the foot
    std::size_t messageCount_ = 0;                  // in the last frame
    std::uint32_t picked_ = 0;                      // a node, in the last frame
    float x_ = -1, y_ = -1;
    bool held_ = false;     // pressed in a panel
    bool outside_ = false;  // pressed elsewhere
    std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace rtsg
