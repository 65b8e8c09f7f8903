// What the overlay's parts draw with: their colours, and text that ImGui does not take apart.
//
// Threading: between ImGui::NewFrame() and ImGui::Render(), on their thread.
#pragma once

#include <array>
#include <cstdio>
#include <string>

#include <imgui.h>

#include "overlay_fonts.h"

namespace rtsg {

constexpr ImU32 kAccent = IM_COL32(96, 176, 255, 255), kWrong = IM_COL32(255, 122, 92, 255);
constexpr ImU32 kDim = IM_COL32(150, 156, 168, 255), kEvent = IM_COL32(255, 204, 92, 255);
constexpr float kGap = 8;  // between panels, on a usual display

template <class... Numbers>
std::string text(const char* format, Numbers... numbers) {
    std::array<char, 96> buffer{};
    std::snprintf(buffer.data(), buffer.size(), format, numbers...);
    return buffer.data();
}

/// A label that ImGui does not take apart at "##".
inline void put(ImU32 color, const std::string& words) {
    ImGui::PushStyleColor(ImGuiCol_Text, color);
    const std::string line = visual(words);
    ImGui::TextUnformatted(line.data(), line.data() + line.size());
    ImGui::PopStyleColor();
}
inline ImU32 ink() {
    return ImGui::GetColorU32(ImGuiCol_Text);
}

/// Two columns, of which the first is as wide as its words.
inline bool beginLines(const char* name) {
    if (!ImGui::BeginTable(name, 2, ImGuiTableFlags_SizingFixedFit)) return false;
    ImGui::TableSetupColumn("name", ImGuiTableColumnFlags_WidthFixed);
    ImGui::TableSetupColumn("value", ImGuiTableColumnFlags_WidthStretch);
    return true;
}

}  // namespace rtsg
