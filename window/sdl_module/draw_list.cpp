// Fills triangles by the processor; most of them are halves of rectangles, which are filled row by row.
#include "draw_list.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace rtsg {

namespace {

struct Clip {
    int left = 0, top = 0, right = 0, bottom = 0;
    bool empty() const { return left >= right || top >= bottom; }
    Clip within(float x0, float y0, float x1, float y1) const {
        return {std::max(left, static_cast<int>(std::ceil(x0 - .5f))),
                std::max(top, static_cast<int>(std::ceil(y0 - .5f))),
                std::min(right, static_cast<int>(std::ceil(x1 - .5f))),
                std::min(bottom, static_cast<int>(std::ceil(y1 - .5f)))};
    }
};

std::uint32_t channel(ImU32 color, int shift) {
    return color >> shift & 0xFFU;
}

/// `alpha` of 255.
void blend(std::uint8_t* pixel, ImU32 color, std::uint32_t alpha) {
    const std::uint32_t back = 255 - alpha;
    pixel[0] = static_cast<std::uint8_t>((pixel[0] * back + channel(color, IM_COL32_B_SHIFT) * alpha + 127) / 255);
    pixel[1] = static_cast<std::uint8_t>((pixel[1] * back + channel(color, IM_COL32_G_SHIFT) * alpha + 127) / 255);
    pixel[2] = static_cast<std::uint8_t>((pixel[2] * back + channel(color, IM_COL32_R_SHIFT) * alpha + 127) / 255);
}

class Painter {
  public:
    Painter(const Coverage& atlas, const PixelRows& target) : atlas_(atlas), target_(target) {}

    /// Upright, of one colour, from corner `a` to the opposite corner `c`.
    void rectangle(const ImDrawVert& a, const ImDrawVert& c, const Clip& clip) {
        const Clip area = clip.within(a.pos.x, a.pos.y, c.pos.x, c.pos.y);
        if (area.empty()) return;
        const bool plain = a.uv.x == c.uv.x && a.uv.y == c.uv.y;
        const float across = (c.uv.x - a.uv.x) / (c.pos.x - a.pos.x), down = (c.uv.y - a.uv.y) / (c.pos.y - a.pos.y);
        const std::uint32_t alpha = channel(a.col, IM_COL32_A_SHIFT) * (plain ? covered(a.uv.x, a.uv.y) : 255) / 255;
        for (int y = area.top; y < area.bottom; ++y) {
            std::uint8_t* row = rowOf(y);
            const float v = a.uv.y + (static_cast<float>(y) + .5f - a.pos.y) * down;
            for (int x = area.left; x < area.right; ++x) {
                const float u = a.uv.x + (static_cast<float>(x) + .5f - a.pos.x) * across;
                const std::uint32_t here = plain ? alpha : alpha * covered(u, v) / 255;
                if (here > 0) blend(row + 4 * static_cast<std::ptrdiff_t>(x), a.col, here);
            }
        }
    }

    void triangle(const ImDrawVert& a, const ImDrawVert& b, const ImDrawVert& c, const Clip& clip) {
        const float area = cross(a.pos, b.pos, c.pos);
        if (!(std::abs(area) > 1e-6f)) return;
        const Clip box = clip.within(std::min({a.pos.x, b.pos.x, c.pos.x}), std::min({a.pos.y, b.pos.y, c.pos.y}),
                                     std::max({a.pos.x, b.pos.x, c.pos.x}), std::max({a.pos.y, b.pos.y, c.pos.y}));
        for (int y = box.top; y < box.bottom; ++y) {
            std::uint8_t* row = rowOf(y);
            for (int x = box.left; x < box.right; ++x) {
                const ImVec2 at(static_cast<float>(x) + .5f, static_cast<float>(y) + .5f);
                const std::array<float, 3> weights{cross(b.pos, c.pos, at) / area, cross(c.pos, a.pos, at) / area,
                                                   cross(a.pos, b.pos, at) / area};
                // A pixel on an edge that two triangles share belongs to one of them.
                if (weights[0] < 0 || weights[1] < 0 || weights[2] <= 0) continue;
                const auto mix = [&](float p, float q, float r) {
                    return weights[0] * p + weights[1] * q + weights[2] * r;
                };
                ImU32 color = 0;
                for (const int shift : {IM_COL32_R_SHIFT, IM_COL32_G_SHIFT, IM_COL32_B_SHIFT, IM_COL32_A_SHIFT})
                    // NOLINTNEXTLINE(bugprone-incorrect-roundings): not negative
                    color |= static_cast<ImU32>(mix(static_cast<float>(channel(a.col, shift)),
                                                    static_cast<float>(channel(b.col, shift)),
                                                    static_cast<float>(channel(c.col, shift))) +
                                                .5f)
                             << shift;
                const std::uint32_t alpha = channel(color, IM_COL32_A_SHIFT) *
                                            covered(mix(a.uv.x, b.uv.x, c.uv.x), mix(a.uv.y, b.uv.y, c.uv.y)) / 255;
                if (alpha > 0) blend(row + 4 * static_cast<std::ptrdiff_t>(x), color, alpha);
            }
        }
    }

  private:
    std::uint8_t* rowOf(int y) const { return target_.pixels + static_cast<std::ptrdiff_t>(y) * target_.stride; }
    static float cross(const ImVec2& a, const ImVec2& b, const ImVec2& c) {
        return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    }
    std::uint32_t covered(float u, float v) const {
        const int x = std::clamp(static_cast<int>(u * static_cast<float>(atlas_.width)), 0, atlas_.width - 1);
        const int y = std::clamp(static_cast<int>(v * static_cast<float>(atlas_.height)), 0, atlas_.height - 1);
        return atlas_.texels[static_cast<std::ptrdiff_t>(y) * atlas_.width + x];
    }

    const Coverage& atlas_;
    const PixelRows& target_;
};

/// Whether two triangles are an upright rectangle of one colour, as ImGui makes them: corners a, b, c and a, c, d.
bool isRectangle(const ImDrawVert* v, const ImDrawIdx* i) {
    if (i[0] != i[3] || i[2] != i[4]) return false;
    const ImDrawVert &a = v[i[0]], &b = v[i[1]], &c = v[i[2]], &d = v[i[5]];
    return a.pos.y == b.pos.y && b.pos.x == c.pos.x && c.pos.y == d.pos.y && d.pos.x == a.pos.x && a.pos.x < c.pos.x &&
           a.pos.y < c.pos.y && a.col == b.col && a.col == c.col && a.col == d.col && a.uv.y == b.uv.y &&
           b.uv.x == c.uv.x && c.uv.y == d.uv.y && d.uv.x == a.uv.x;
}

}  // namespace

void draw(const ImDrawData& data, const Coverage& atlas, const PixelRows& target) {
    Painter painter(atlas, target);
    for (int l = 0; l < data.CmdListsCount; ++l) {
        const ImDrawList& list = *data.CmdLists[l];
        for (const ImDrawCmd& command : list.CmdBuffer) {
            if (command.UserCallback) continue;  // nobody here makes one
            const Clip clip = Clip{0, 0, target.width, target.height}.within(command.ClipRect.x, command.ClipRect.y,
                                                                             command.ClipRect.z, command.ClipRect.w);
            if (clip.empty()) continue;
            const ImDrawVert* vertices = list.VtxBuffer.Data + command.VtxOffset;
            const ImDrawIdx* index = list.IdxBuffer.Data + command.IdxOffset;
            for (unsigned i = 0; i + 2 < command.ElemCount;) {
                if (i + 5 < command.ElemCount && isRectangle(vertices, index + i)) {
                    painter.rectangle(vertices[index[i]], vertices[index[i + 2]], clip);
                    i += 6;
                    continue;
                }
                painter.triangle(vertices[index[i]], vertices[index[i + 1]], vertices[index[i + 2]], clip);
                i += 3;
            }
        }
    }
}

}  // namespace rtsg
