// The overlay's parts for everybody: the bar at the top with its menus, messages, the list of keys, files, and tips.
#include <algorithm>
#include <cmath>
#include <utility>

#include "overlay.h"
#include "overlay_draw.h"

namespace rtsg {

namespace {

using Kind = OverlayAction::Kind;
using Level = OverlayContent::Message::Level;

constexpr std::pair<const char*, const char*> kTypes[] = {{"EXAMINE", "go round the scene"},
                                                          {"WALK", "on the ground"},
                                                          {"FLY", "in the direction of view"},
                                                          {"LOOKAT", "a click goes to a thing"},
                                                          {"NONE", "stand still"}};
constexpr std::pair<const char*, const char*> kPictures[] = {
    {"whitted", "sharp shadows and mirrors"}, {"path", "all light, slowly"}, {"OGRE", "a graphics card, no shadows"}};

ImU32 colorOf(Level level) {
    return level == Level::error ? kWrong : level == Level::warning ? kEvent : ink();
}

/// A row that is clicked as a whole: a name, and a remark.
bool rowOf(int number, const std::string& name, const std::string& remark, bool isChosen) {
    ImGui::PushID(number);
    const ImVec2 at = ImGui::GetCursorPos();
    const bool clicked = ImGui::Selectable("##row", isChosen);
    ImGui::SetCursorPos(ImVec2(at.x + 6, at.y));
    put(ink(), name);
    if (!remark.empty()) {
        ImGui::SameLine(0, 12);
        put(kDim, remark);
    }
    ImGui::PopID();
    return clicked;
}

}  // namespace

/// A button of the bar; it goes to the next row where the bar is full.
bool Overlay::item(const std::string& label, bool isOn) {
    const ImGuiStyle& style = ImGui::GetStyle();
    const float width = ImGui::CalcTextSize(label.c_str(), nullptr, true).x + 2 * style.FramePadding.x;
    const float right = ImGui::GetWindowPos().x + ImGui::GetWindowContentRegionMax().x;
    if (!std::exchange(isFirstItem_, false) && ImGui::GetItemRectMax().x + style.ItemSpacing.x + width < right)
        ImGui::SameLine();
    if (isOn) ImGui::PushStyleColor(ImGuiCol_Button, IM_COL32(58, 108, 168, 190));
    const bool clicked = ImGui::Button(label.c_str());
    if (isOn) ImGui::PopStyleColor();
    return clicked;
}

/// The same with a menu below it.
bool Overlay::menuItem(const char* name, const std::string& label) {
    const bool clicked = item(label + "    ", menu_ == name);
    const ImVec2 low = ImGui::GetItemRectMin(), high = ImGui::GetItemRectMax();
    const float x = high.x - 12 * scale_, y = (low.y + high.y) / 2, half = 4 * scale_;
    ImGui::GetWindowDrawList()->AddTriangleFilled(ImVec2(x - half, y - half / 2), ImVec2(x + half, y - half / 2),
                                                  ImVec2(x, y + half), kDim);
    if (menu_ == name) menuAt_ = low.x;
    if (!clicked) return false;
    menu_ = menu_ == name ? "" : name;
    menuAt_ = low.x, menuIsNew_ = true;
    return true;
}

void Overlay::bar() {
    const ImGuiStyle& style = ImGui::GetStyle();
    if (barHeight_ <= 0) barHeight_ = ImGui::GetFrameHeight() + 2 * style.WindowPadding.y;
    ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, ImVec2(6 * scale_, 4 * scale_));
    if (begin("bar", {0, 0, ImGui::GetIO().DisplaySize.x, barHeight_})) {
        isFirstItem_ = true;
        barItems();
        barHeight_ = ImGui::GetCursorPosY() - style.ItemSpacing.y + 4 * scale_;
    }
    ImGui::End();
    ImGui::PopStyleVar(2);
    if (!menu_.empty()) menu();
}

void Overlay::barItems() {
    const OverlayContent::Bar& bar = *content_->bar;
    if (item("Open", content_->files.has_value())) act(Kind::files);
    if (bar.canGoBack && item("Back")) act(Kind::back);
    if (!content_->viewpoints.empty()) menuItem("viewpoints", "Viewpoints");
    if (!bar.navigation.empty()) {
        menuItem("navigation", bar.navigation);
        if (item("Walls", bar.walls)) act(Kind::walls);
        if (item("Gravity", bar.ground)) act(Kind::ground);
        if (item("-##speed")) act(Kind::speed, 0, .5);
        if (item(text("%.3g m/s", bar.speed))) act(Kind::speed, 0, 1 / bar.speed);
        if (item("+##speed")) act(Kind::speed, 0, 2);
    }
    if (item("View all")) act(Kind::viewAll);
    if (item("Upright")) act(Kind::straighten);
    if (!bar.pictures.empty()) menuItem("pictures", bar.pictures);
    if (bar.volume) {
        constexpr double kStep = .1;
        if (item("-##sound")) act(Kind::volume, 0, std::max(0., *bar.volume - kStep));
        if (item(text("Sound %.0f %%", 100 * *bar.volume), *bar.volume > 0))
            act(Kind::volume, 0, *bar.volume > 0 ? 0 : 1);
        if (item("+##sound")) act(Kind::volume, 0, std::min(1., *bar.volume + kStep));
    }
    if (item("Picture")) act(Kind::screenshot);
    if (item("Log", bar.writesLog)) act(Kind::log);
    if (item("Film", bar.writesFilm)) act(Kind::film);
    if (item("Nodes", content_->hasDetails)) act(Kind::details);
    if (item("Keys", !content_->keys.empty())) act(Kind::keys);
    if (item("x")) act(Kind::hideBar);
}

void Overlay::menu() {
    const ImVec2 screen = ImGui::GetIO().DisplaySize;
    const float line = ImGui::GetTextLineHeightWithSpacing(), width = std::min(300 * scale_, screen.x);
    const std::size_t rows = menu_ == "viewpoints"   ? content_->viewpoints.size()
                             : menu_ == "navigation" ? std::size(kTypes)
                                                     : std::size(kPictures);
    const float height = std::min(static_cast<float>(rows) * line + 24 * scale_, screen.y - barHeight_ - kGap);
    if (std::exchange(menuIsNew_, false)) ImGui::SetNextWindowFocus();
    const float x = std::clamp(menuAt_, 0.f, std::max(0.f, screen.x - width));
    bool isChosen = false;
    if (begin("menu", {x, barHeight_ + 2, width, height})) {
        int number = 0;
        if (menu_ == "viewpoints")
            for (const OverlayContent::Viewpoint& view : content_->viewpoints)
                if (rowOf(number++, view.name, {}, view.isBound)) act(Kind::viewpoint, view.node), isChosen = true;
        if (menu_ == "navigation")
            for (const auto& [name, what] : kTypes)
                if (rowOf(number++, name, what, content_->bar->navigation == name))
                    act(Kind::navigation, 0, 0, name), isChosen = true;
        if (menu_ == "pictures")
            for (const auto& [name, what] : kPictures)
                if (rowOf(number++, name, what, content_->bar->pictures == name))
                    act(Kind::pictures, 0, 0, name), isChosen = true;
    }
    ImGui::End();
    if (isChosen) menu_.clear();
}

/// The newest message in a line at the foot, or all of them.
void Overlay::messages() {
    if (content_->messages.empty()) return;
    const ImVec2 screen = ImGui::GetIO().DisplaySize;
    const float line = ImGui::GetTextLineHeightWithSpacing(), foot = screen.y - below_ - kGap;
    const float rows = content_->listsMessages ? 2 + static_cast<float>(content_->messages.size()) : 0;
    const float height = content_->listsMessages ? std::min(rows * line + 30 * scale_, .45f * screen.y)
                                                 : ImGui::GetFrameHeight() + 2 * ImGui::GetStyle().WindowPadding.y;
    if (!begin("messages", {kGap, foot - height, screen.x - 2 * kGap, height})) return ImGui::End();
    const std::string count = text("%zu", content_->messageCount);
    if (ImGui::Button((content_->listsMessages ? count + " messages: hide" : count + " messages").c_str()))
        act(Kind::messages);
    ImGui::SameLine();
    if (content_->listsMessages) {
        if (ImGui::Button("Copy")) act(Kind::copy);
        ImGui::SameLine();
    }
    if (ImGui::Button("Forget")) act(Kind::forget);
    if (!content_->listsMessages) {
        const OverlayContent::Message& newest = content_->messages.back();
        ImGui::SameLine();
        put(colorOf(newest.level), newest.text);
    } else {
        ImGui::BeginChild("all");
        ImGui::PushTextWrapPos(0);
        for (const OverlayContent::Message& message : content_->messages) put(colorOf(message.level), message.text);
        ImGui::PopTextWrapPos();
        if (std::exchange(messageCount_, content_->messageCount) != content_->messageCount) ImGui::SetScrollHereY(1);
        ImGui::EndChild();
    }
    ImGui::End();
}

void Overlay::keys() {
    if (content_->keys.empty()) return;
    const ImVec2 screen = ImGui::GetIO().DisplaySize;
    const float top = barHeight_ + kGap, line = ImGui::GetTextLineHeightWithSpacing();
    const float width = std::min(620 * scale_, screen.x - 2 * kGap);
    const float wanted = (static_cast<float>(content_->keys.size()) + 2) * line + 36 * scale_;
    const float height = std::min(wanted, screen.y - top - kGap);
    if (begin("keys", {(screen.x - width) / 2, top, width, height})) {
        put(kAccent, "Keys and pointer");
        ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - ImGui::GetFrameHeight());
        if (ImGui::Button("x")) act(Kind::keys);
        ImGui::BeginChild("list");
        lines("keys", content_->keys);
        ImGui::EndChild();
    }
    ImGui::End();
}

void Overlay::files() {
    if (!content_->files) return;
    const ImVec2 screen = ImGui::GetIO().DisplaySize;
    const float top = barHeight_ + kGap, width = std::min(520 * scale_, screen.x - 2 * kGap);
    const float height = std::max(80.f, std::min(460 * scale_, screen.y - top - kGap));
    if (begin("files", {kGap, top, width, height})) {
        put(kAccent, content_->files->folder);
        ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - ImGui::GetFrameHeight());
        if (ImGui::Button("x")) act(Kind::files);
        ImGui::BeginChild("list");
        int number = 0;
        for (const OverlayContent::Files::Entry& entry : content_->files->entries)
            if (rowOf(number++, entry.isFolder ? entry.name + "/" : entry.name, {}, false))
                act(entry.isFolder ? Kind::folder : Kind::file, 0, 0, entry.name);
        ImGui::EndChild();
    }
    ImGui::End();
}

/// What is under the pointer says so beside it.
void Overlay::tip() {
    if (content_->tip.empty() || x_ < 0) return;
    const ImVec2 screen = ImGui::GetIO().DisplaySize, size = ImGui::CalcTextSize(content_->tip.c_str());
    const float pad = 6 * scale_;
    const float x = std::clamp(x_ + 14 * scale_, 0.f, std::max(0.f, screen.x - size.x - 2 * pad));
    const float y = std::clamp(y_ + 18 * scale_, 0.f, std::max(0.f, screen.y - size.y - 2 * pad));
    ImDrawList& front = *ImGui::GetForegroundDrawList();
    front.AddRectFilled(ImVec2(x, y), ImVec2(x + size.x + 2 * pad, y + size.y + 2 * pad), IM_COL32(40, 46, 58, 250), 4);
    front.AddText(ImVec2(x + pad, y + pad), ink(), visual(content_->tip).c_str());
}

}  // namespace rtsg
