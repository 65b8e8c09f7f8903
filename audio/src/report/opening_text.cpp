// Writes where a room loses sound.
#include "opening_text.h"

#include <fmt/format.h>

#include "json_text.h"
#include "report_figures.h"

namespace rtsg {
namespace {

/// Below this no digit of a share is known.
constexpr double kNothing = 1e-6;

/// In the unit that leaves one to three digits before the point.
std::string metresText(double metres) {
    if (metres < 0.01) return fmt::format("{:.2g} mm", 1e3 * metres);
    if (metres < 1) return fmt::format("{:.2g} cm", 1e2 * metres);
    return fmt::format("{:.2g} m", metres);
}

}  // namespace

std::string percentText(double fraction) {
    return fmt::format("{:.2g} %", 100 * fraction);
}

std::string openingsJson(const RoomOpenings& openings) {
    std::string text = fmt::format("{{\"escaped\":{},\"outdoors\":{}", jsonNumber(openings.escaped), openings.outdoors);
    if (openings.fraction > 0) {
        const glm::dvec3& p = openings.center;
        text += fmt::format(
            ",\"by\":{{\"share\":{},\"center\":[{},{},{}],\"length\":{},\"width\":{},\"area\":{},\"leak\":{},"
            "\"beside\":[",
            jsonNumber(openings.fraction), jsonNumber(p.x), jsonNumber(p.y), jsonNumber(p.z),
            jsonNumber(openings.length), jsonNumber(openings.width), jsonNumber(openings.area), openings.leak);
        for (const WallShape& one : openings.beside)
            text += (&one == openings.beside.data() ? "" : ",") + jsonString(one.name);
        text += "]}";
    }
    return text + "}";
}

std::string listed(const std::vector<std::string>& names) {
    std::string text;
    for (const std::string& one : names) text += (text.empty() ? "" : &one == &names.back() ? " and " : ", ") + one;
    return text;
}

std::string namesBeside(const RoomOpenings& openings) {
    std::vector<std::string> names;
    for (const WallShape& one : openings.beside) names.push_back(printable(one.name));
    return listed(names);
}

std::string lossText(const RoomOpenings& openings, const std::string& source, const std::string& beside) {
    if (openings.outdoors || !(openings.escaped > kNothing)) return "";
    std::string text = fmt::format("some {} of the sound of {} leaves the room", percentText(openings.escaped), source);
    if (!(openings.fraction > 0)) return text;
    constexpr double kCrack = 10;
    const std::string what =
        openings.length > kCrack * openings.width
            ? fmt::format("a crack of {} x {}", metresText(openings.length), metresText(openings.width))
            : fmt::format("{} of {:.2g} m2", openings.leak ? "a hole" : "an opening", openings.area);
    const glm::dvec3& p = openings.center;
    text += fmt::format(", {} by {} near {:.2f} {:.2f} {:.2f}", percentText(openings.fraction), what, p.x, p.y, p.z);
    if (!beside.empty()) text += " beside " + beside;
    return text + (openings.triangle ? ", which lacks a triangle" : "");
}

}  // namespace rtsg
