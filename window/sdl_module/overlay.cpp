// Lays out the overlay's panels, and reports the user's actions in them.
#include "overlay.h"
#include "overlay_draw.h"

#include <algorithm>
#include <cfloat>
#include <cmath>

namespace rtsg {

namespace {

using Kind = OverlayAction::Kind;

constexpr float kFont = 15, kTimeline = 72, kDot = 5;
constexpr int kBars = 120;  // of the curve
enum Shape : int { play, pauses, back, ahead };

}  // namespace

Overlay::Overlay(float scale) : context_(ImGui::CreateContext()), scale_(scale), fonts_(std::round(kFont * scale)) {
    ImGuiIO& io = ImGui::GetIO();
    io.IniFilename = nullptr;  // nothing is written
    makeFonts();
    style();
}
Overlay::~Overlay() {
    ImGui::DestroyContext(context_);
}

void Overlay::makeFonts() {
    ImFontAtlas& atlas = *ImGui::GetIO().Fonts;
    if (!fonts_.make(atlas)) return;
    unsigned char* texels = nullptr;
    atlas.GetTexDataAsAlpha8(&texels, &atlas_.width, &atlas_.height);
    atlas_.texels = texels;
}

void Overlay::set(std::shared_ptr<const OverlayContent> content) {
    content_ = std::move(content);
    const OverlayContent& all = *content_;
    for (const auto& view : all.viewpoints) fonts_.need(view.name);
    for (const auto& row : all.tree) fonts_.need(row.name);
    for (const auto& message : all.messages) fonts_.need(message.text);
    for (const auto* lines : {&all.lines, &all.history})
        for (const auto& line : *lines) fonts_.need(line.name), fonts_.need(line.value);
    if (all.picked) {
        fonts_.need(all.picked->name);
        for (const auto& field : all.picked->fields) fonts_.need(field.name), fonts_.need(field.value);
        for (const auto& route : all.picked->routes) fonts_.need(route);
    }
    if (all.files)
        for (const auto& entry : all.files->entries) fonts_.need(entry.name);
    if (all.timeline && all.timeline->marks)
        for (const auto& mark : *all.timeline->marks) fonts_.need(mark.text);
    fonts_.need(all.tip);
    makeFonts();
}

void Overlay::style() {
    ImGui::StyleColorsDark();
    ImGuiStyle& s = ImGui::GetStyle();
    s.AntiAliasedLinesUseTex = false;  // that counts on a texture that is interpolated
    s.WindowRounding = 7;
    s.FrameRounding = s.GrabRounding = s.ScrollbarRounding = 4;
    s.WindowBorderSize = 0;
    s.WindowPadding = ImVec2(12, 10);
    s.ItemSpacing = ImVec2(8, 4);
    s.CellPadding = ImVec2(6, 1);
    s.ScrollbarSize = 11;
    s.ScaleAllSizes(scale_);
    const auto color = [&s](ImGuiCol which, int r, int g, int b, int a) {
        s.Colors[which] = ImGui::ColorConvertU32ToFloat4(IM_COL32(r, g, b, a));
    };
    color(ImGuiCol_WindowBg, 17, 20, 27, 226);
    color(ImGuiCol_Text, 232, 235, 240, 255);
    color(ImGuiCol_ChildBg, 0, 0, 0, 0);
    color(ImGuiCol_ScrollbarBg, 0, 0, 0, 0);
    color(ImGuiCol_Header, 58, 108, 168, 190);
    color(ImGuiCol_HeaderHovered, 66, 92, 128, 170);
    color(ImGuiCol_HeaderActive, 70, 128, 196, 210);
    color(ImGuiCol_Separator, 255, 255, 255, 40);
    color(ImGuiCol_Button, 255, 255, 255, 22);
    color(ImGuiCol_ButtonHovered, 255, 255, 255, 52);
    color(ImGuiCol_ButtonActive, 96, 176, 255, 120);
}

void Overlay::setSize(int width, int height) {
    ImGui::GetIO().DisplaySize = ImVec2(static_cast<float>(width), static_cast<float>(height));
}

bool Overlay::pointer(float x, float y, bool down) {
    ImGuiIO& io = ImGui::GetIO();
    x_ = x, y_ = y;
    const bool over = std::ranges::any_of(panels_, [&](const Box& box) { return box.holds(x, y); });
    const bool was = held_;
    if (!down)
        held_ = outside_ = false;
    else if (!held_ && !outside_)
        (over ? held_ : outside_) = true;
    if (outside_) menu_.clear();
    const bool mine = was || held_ || (over && !outside_);
    io.MousePos = mine ? ImVec2(x, y) : ImVec2(-FLT_MAX, -FLT_MAX);
    io.MouseDown[0] = held_;
    if (mine && content_) frame();
    return mine;
}

void Overlay::pointerLeft() {
    x_ = y_ = -1;
    if (!held_) ImGui::GetIO().MousePos = ImVec2(-FLT_MAX, -FLT_MAX);
}

bool Overlay::wheel(float down) {
    if (!std::ranges::any_of(panels_, [&](const Box& box) { return box.holds(x_, y_); })) return false;
    ImGui::GetIO().MouseWheel -= down;
    if (content_) frame();
    return true;
}

void Overlay::paint(const PixelRows& target) {
    if (!content_) return;
    setSize(target.width, target.height);
    frame();
    draw(*ImGui::GetDrawData(), atlas_, target);
}

bool Overlay::begin(const char* name, const Box& box) {
    panels_.push_back(box);
    ImGui::SetNextWindowPos(ImVec2(box.x, box.y));
    ImGui::SetNextWindowSize(ImVec2(box.width, box.height));
    return ImGui::Begin(name, nullptr,
                        ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
                            ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoNav);
}

void Overlay::frame() {
    ImGuiIO& io = ImGui::GetIO();
    const auto now = std::chrono::steady_clock::now();
    io.DeltaTime = std::clamp(std::chrono::duration<float>(now - std::exchange(last_, now)).count(), 1e-3f, .1f);
    ImGui::NewFrame();
    panels_.clear();
    below_ = content_->hasDetails && content_->timeline ? kTimeline * scale_ + kGap : 0;
    if (content_->bar)
        bar();
    else
        barHeight_ = 0;
    if (content_->hasDetails) details();
    messages();
    keys();
    files();
    tip();
    ImGui::Render();
}

/// Panels at the sides, below the bar and above the time line.
void Overlay::details() {
    const ImVec2 screen = ImGui::GetIO().DisplaySize;
    const float top = barHeight_ + kGap, height = screen.y - top - kGap - below_;
    const float width = std::min(std::clamp(screen.x * .26f, 220 * scale_, 350 * scale_), screen.x / 2 - 1.5f * kGap);
    const float right = screen.x - kGap - width;
    const float line = ImGui::GetTextLineHeightWithSpacing();
    const auto rows = static_cast<float>(content_->lines.size());
    const float upper = std::min(height * .62f, (rows + 1) * line + 66 * scale_);
    const auto views = static_cast<float>(content_->viewpoints.size());
    if (begin("figures", {kGap, top, width, upper})) figures();
    ImGui::End();
    const float lower = std::min(height - upper - kGap, (views + 1) * line + 28 * scale_);
    if (views > 0 && begin("viewpoints", {kGap, top + kGap + upper, width, lower})) viewpoints();
    if (views > 0) ImGui::End();
    const float part = content_->picked ? std::floor(height * .42f) : height;
    if (begin("tree", {right, top, width, part})) tree();
    ImGui::End();
    if (content_->picked) {
        if (begin("picked", {right, top + kGap + part, width, height - part - kGap})) picked();
        ImGui::End();
    }
    if (content_->timeline) {
        const float tall = kTimeline * scale_;
        if (begin("timeline", {kGap, screen.y - kGap - tall, screen.x - 2 * kGap, tall})) timeline();
        ImGui::End();
    }
}

void Overlay::figures() {
    put(kAccent, "Picture");
    curve();
    lines("figures", content_->lines);
}

void Overlay::lines(const char* name, const std::vector<OverlayContent::Line>& all) {
    if (!beginLines(name)) return;
    int number = 0;
    for (const OverlayContent::Line& line : all) {
        ImGui::PushID(number++);
        ImGui::TableNextColumn();
        const ImVec2 at = ImGui::GetCursorPos();
        if (line.time && ImGui::Selectable("##line", false, ImGuiSelectableFlags_SpanAllColumns))
            act(Kind::seek, 0, *line.time);
        ImGui::SetCursorPos(at);
        put(line.time ? kAccent : kDim, line.name);
        ImGui::TableNextColumn();
        put(line.isWrong ? kWrong : ink(), line.value);
        ImGui::PopID();
    }
    ImGui::EndTable();
}

/// The time from each picture in motion to the next, and the budget.
void Overlay::curve() {
    const std::vector<float>& times = content_->frameTimes;
    const ImVec2 at = ImGui::GetCursorScreenPos();
    const float width = ImGui::GetContentRegionAvail().x, height = 42;
    ImDrawList& list = *ImGui::GetWindowDrawList();
    list.AddRectFilled(at, ImVec2(at.x + width, at.y + height), IM_COL32(255, 255, 255, 14), 3);
    const float maximum = 3 * content_->budget, step = width / kBars;
    const auto first = times.size() > kBars ? times.size() - kBars : 0;
    for (std::size_t i = first; i < times.size(); ++i) {
        const float fraction = std::min(times[i] / maximum, 1.f);
        const float x = at.x + step * static_cast<float>(i - first);
        const ImU32 color = times[i] > 1.5f * content_->budget ? kWrong : kAccent;
        list.AddRectFilled(ImVec2(x, at.y + height * (1 - fraction)),
                           ImVec2(x + std::max(step - 1, 1.f), at.y + height), color);
    }
    const float budget = at.y + height * 2 / 3;
    list.AddRectFilled(ImVec2(at.x, budget), ImVec2(at.x + width, budget + 1), IM_COL32(255, 255, 255, 110));
    const std::string label = text("%.0f ms", static_cast<double>(content_->budget));
    const ImVec2 size = ImGui::CalcTextSize(label.c_str());
    const ImVec2 corner(at.x + width - size.x - 4, budget - size.y - 3);
    list.AddRectFilled(ImVec2(corner.x - 3, corner.y - 1), ImVec2(at.x + width, budget - 1), IM_COL32(17, 20, 27, 200),
                       3);
    list.AddText(corner, ink(), label.c_str());
    ImGui::Dummy(ImVec2(width, height + 4));
}

void Overlay::viewpoints() {
    put(kAccent, "Viewpoints");
    ImGui::BeginChild("list");
    int number = 0;
    for (const OverlayContent::Viewpoint& view : content_->viewpoints) {
        ImGui::PushID(number++);
        const ImVec2 at = ImGui::GetCursorPos();
        if (ImGui::Selectable("##view", view.isBound)) act(Kind::viewpoint, view.node);
        ImGui::SetCursorPos(ImVec2(at.x + 6, at.y));
        put(ink(), view.name);
        ImGui::PopID();
    }
    ImGui::EndChild();
}

void Overlay::tree() {
    put(kAccent, "Scene");
    ImGui::BeginChild("rows");
    const float line = ImGui::GetTextLineHeightWithSpacing();
    const std::uint32_t picked = content_->picked ? content_->picked->node : 0;
    // Scroll to the node that has just been picked.
    const auto at = std::ranges::find_if(content_->tree, [](const OverlayContent::Row& row) { return row.isPicked; });
    if (std::exchange(picked_, picked) != picked && at != content_->tree.end()) {
        const float y = line * static_cast<float>(at - content_->tree.begin()), seen = ImGui::GetWindowHeight();
        if (y < ImGui::GetScrollY() || y + line > ImGui::GetScrollY() + seen) ImGui::SetScrollY(y - seen / 2);
    }
    ImGuiListClipper clipper;
    clipper.Begin(static_cast<int>(content_->tree.size()), line);
    while (clipper.Step())
        for (int i = clipper.DisplayStart; i < clipper.DisplayEnd; ++i) {
            ImGui::PushID(i);
            row(content_->tree[static_cast<std::size_t>(i)]);
            ImGui::PopID();
        }
    ImGui::EndChild();
}

void Overlay::row(const OverlayContent::Row& row) {
    if (row.node == 0) return put(kDim, row.name);
    ImDrawList& list = *ImGui::GetWindowDrawList();
    const ImVec2 start = ImGui::GetCursorPos(), corner = ImGui::GetCursorScreenPos();
    const float indent = static_cast<float>(row.depth) * 13, line = ImGui::GetTextLineHeight();
    const float right = ImGui::GetContentRegionAvail().x;
    // Controls on top come first, because those under them then do not react.
    if (row.hides) {
        const ImVec2 middle(corner.x + right - line / 2, corner.y + line / 2);
        ImGui::SetCursorPos(ImVec2(start.x + right - line, start.y));
        if (ImGui::InvisibleButton("seen", ImVec2(line, line))) act(Kind::hide, row.node);
        if (ImGui::IsItemHovered()) list.AddCircleFilled(middle, kDot + 2, IM_COL32(255, 255, 255, 50));
        row.isVisible ? list.AddCircleFilled(middle, kDot - 1, kAccent) : list.AddCircle(middle, kDot - 1, kDim);
    }
    if (row.opens) {
        ImGui::SetCursorPos(ImVec2(start.x + indent, start.y));
        if (ImGui::InvisibleButton("open", ImVec2(line, line))) act(Kind::open, row.node);
        const float x = corner.x + indent + 4, y = corner.y + line / 2;
        if (row.isOpen)
            list.AddTriangleFilled(ImVec2(x, y - 3), ImVec2(x + 9, y - 3), ImVec2(x + 4.5f, y + 4), kDim);
        else
            list.AddTriangleFilled(ImVec2(x + 1, y - 5), ImVec2(x + 8, y), ImVec2(x + 1, y + 5), kDim);
    }
    const float from = indent + line + 2;
    ImGui::SetCursorPos(ImVec2(start.x + from, start.y));
    const float wide = std::max(1.f, right - from - (row.hides ? line + 4 : 0));
    if (ImGui::Selectable("##row", row.isPicked, 0, ImVec2(wide, 0))) act(Kind::pick, row.node);
    ImGui::PushClipRect(ImVec2(corner.x + from, corner.y - 2), ImVec2(corner.x + from + wide, corner.y + line + 4),
                        true);
    ImGui::SetCursorPos(ImVec2(start.x + from + 3, start.y));
    if (!row.name.empty()) {
        put(row.isVisible ? ink() : kDim, row.name);
        ImGui::SameLine(0, 7);
    }
    put(kDim, row.type);
    ImGui::PopClipRect();
}

void Overlay::picked() {
    const OverlayContent::Picked& node = *content_->picked;
    put(kAccent, node.name.empty() ? "Picked" : node.name);
    ImGui::SameLine();
    put(kDim, node.type);
    ImGui::BeginChild("all");
    if (!content_->history.empty()) {
        lines("history", content_->history);
        ImGui::Separator();
    }
    if (beginLines("fields")) {
        int number = 0;
        for (const OverlayContent::Field& field : node.fields) {
            ImGui::PushID(number++);
            ImGui::TableNextColumn();
            const ImVec2 at = ImGui::GetCursorPos();
            const ImVec2 size = ImGui::CalcTextSize(field.name.c_str());
            if (content_->hasHistory) {
                if (ImGui::InvisibleButton("field", ImVec2(std::max(size.x, 1.f), size.y)))
                    act(Kind::history, node.node, 0, field.name);
                ImGui::SetCursorPos(at);
            }
            put(content_->hasHistory && ImGui::IsItemHovered() ? kAccent : kDim, field.name);
            ImGui::TableNextColumn();
            const ImVec2 value = ImGui::GetCursorPos();
            if (field.node != 0 && ImGui::Selectable("##node")) act(Kind::pick, field.node);
            ImGui::SetCursorPos(value);
            put(field.node != 0 ? kAccent : field.isDefault ? kDim : ink(), field.value);
            ImGui::PopID();
        }
        ImGui::EndTable();
    }
    if (!node.routes.empty()) {
        ImGui::Separator();
        put(kAccent, "Routes");
        for (const std::string& route : node.routes) put(ink(), route);
    }
    ImGui::EndChild();
}

void Overlay::timeline() {
    const OverlayContent::Timeline& line = *content_->timeline;
    controls(line);
    track(line);
}

/// A small button with a picture on it.
bool Overlay::icon(const char* name, int shape) {
    const float side = ImGui::GetTextLineHeight() + 4;
    const bool clicked = ImGui::Button(name, ImVec2(side + 8, side));
    const ImVec2 low = ImGui::GetItemRectMin(), high = ImGui::GetItemRectMax();
    const float x = (low.x + high.x) / 2, y = (low.y + high.y) / 2;
    ImDrawList& list = *ImGui::GetWindowDrawList();
    const auto bar = [&](float from) { list.AddRectFilled(ImVec2(from, y - 5), ImVec2(from + 3, y + 5), ink()); };
    if (shape == play) list.AddTriangleFilled(ImVec2(x - 4, y - 6), ImVec2(x + 6, y), ImVec2(x - 4, y + 6), ink());
    if (shape == pauses) bar(x - 5), bar(x + 2);
    if (shape == ahead)
        list.AddTriangleFilled(ImVec2(x - 6, y - 5), ImVec2(x + 2, y), ImVec2(x - 6, y + 5), ink()), bar(x + 3);
    if (shape == back)
        list.AddTriangleFilled(ImVec2(x + 6, y - 5), ImVec2(x + 6, y + 5), ImVec2(x - 2, y), ink()), bar(x - 6);
    ImGui::SameLine();
    return clicked;
}

void Overlay::controls(const OverlayContent::Timeline& line) {
    if (icon("##play", content_->isPaused ? play : pauses)) act(Kind::pause);
    if (icon("##back", back)) act(Kind::step, 0, -1);
    if (icon("##ahead", ahead)) act(Kind::step, 0, 1);
    constexpr double kSlowest = 1 / 16., kFastest = 64;
    if (ImGui::SmallButton("-")) act(Kind::rate, 0, std::max(kSlowest, line.rate / 2));
    ImGui::SameLine();
    put(ink(), text("%g\xC3\x97", line.rate));
    ImGui::SameLine();
    if (ImGui::SmallButton("+")) act(Kind::rate, 0, std::min(kFastest, line.rate * 2));
    ImGui::SameLine(0, 20);
    put(ink(), text("%.2f s", line.time));
    ImGui::SameLine(0, 4);
    put(kDim, text("of %.2f s", line.length));
}

void Overlay::track(const OverlayContent::Timeline& line) {
    const ImVec2 at = ImGui::GetCursorScreenPos();
    const float width = std::max(ImGui::GetContentRegionAvail().x, 1.f), height = 22, middle = at.y + height / 2;
    ImGui::InvisibleButton("track", ImVec2(width, height));
    const ImGuiIO& io = ImGui::GetIO();
    const double under = std::clamp(static_cast<double>((io.MousePos.x - at.x) / width), 0., 1.) * line.length;
    const bool moved = io.MouseDelta.x != 0 || ImGui::IsItemActivated();
    if (ImGui::IsItemActive() && moved) act(Kind::seek, 0, under);
    const auto columnOf = [&](double time) {
        return at.x + width * static_cast<float>(line.length > 0 ? std::clamp(time / line.length, 0., 1.) : 0);
    };
    ImDrawList& list = *ImGui::GetWindowDrawList();
    list.AddRectFilled(ImVec2(at.x, middle - 2), ImVec2(at.x + width, middle + 2), IM_COL32(255, 255, 255, 44), 2);
    const float knob = columnOf(line.time);
    list.AddRectFilled(ImVec2(at.x, middle - 2), ImVec2(knob, middle + 2), kAccent, 2);
    const OverlayContent::Mark* near = nullptr;
    if (line.marks)
        for (const OverlayContent::Mark& mark : *line.marks) {
            const float x = std::floor(columnOf(mark.time)), half = mark.isDamage ? 9.f : 7.f;
            list.AddRectFilled(ImVec2(x, middle - half), ImVec2(x + 2, middle + half), mark.isDamage ? kWrong : kEvent);
            if (ImGui::IsItemHovered() && std::abs(x - io.MousePos.x) < 5) near = &mark;
        }
    list.AddCircleFilled(ImVec2(knob, middle), 7, IM_COL32(255, 255, 255, 255));
    if (!ImGui::IsItemHovered() && !ImGui::IsItemActive()) return;
    const std::string label = text("%.2f s  ", under) + (near ? near->text : std::string());
    const ImVec2 size = ImGui::CalcTextSize(label.c_str());
    const ImVec2 corner(std::min(io.MousePos.x + 10, at.x + width - size.x - 6), at.y - size.y - 4);
    ImDrawList& front = *ImGui::GetForegroundDrawList();
    front.AddRectFilled(ImVec2(corner.x - 6, corner.y - 3), ImVec2(corner.x + size.x + 6, corner.y + size.y + 3),
                        IM_COL32(40, 46, 58, 250), 4);
    front.AddText(corner, near && near->isDamage ? kWrong : ink(), label.c_str());
}

}  // namespace rtsg
