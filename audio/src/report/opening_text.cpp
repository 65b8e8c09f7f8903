// Writes where a room loses sound.
#include "opening_text.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/markup.h>

#include "json_text.h"
#include "report_figures.h"

namespace rtsg {
namespace {

/// Below this no digit of a share is known.
constexpr double kNothing = 1e-6;

std::string jsonPoint(const glm::dvec3& p) {
    return fmt::format("[{},{},{}]", jsonNumber(p.x), jsonNumber(p.y), jsonNumber(p.z));
}

/// In the unit that leaves one to three digits before the point.
std::string metresText(double metres) {
    if (metres < 0.01) return fmt::format("{:.2g} mm", 1e3 * metres);
    if (metres < 1) return fmt::format("{:.3g} cm", 1e2 * metres);
    return fmt::format("{:.3g} m", metres);
}

std::string namesOf(const RoomOpening& opening) {
    std::string text;
    for (const RoomOpening::Beside& beside : opening.beside)
        text += (text.empty() ? "" : ", ") + printable(beside.name);
    return text;
}

std::string_view kindOf(const RoomOpening& opening) {
    return opening.leak ? "leak" : "opening";
}

std::string centerText(const glm::dvec3& p) {
    return fmt::format("{:.2f} {:.2f} {:.2f}", p.x, p.y, p.z);
}

bool losesSome(const RoomReport::Losses& losses) {
    return !losses.openings.outdoors && losses.openings.escaped > kNothing;
}

}  // namespace

std::string percentText(double fraction) {
    return fmt::format("{:.2g} %", 100 * fraction);
}

std::string sizeText(const RoomOpening& opening) {
    return metresText(opening.length) + " x " + metresText(opening.width);
}

std::string openingsJson(const RoomOpenings& openings) {
    std::string text = fmt::format("{{\"escaped\":{},\"elsewhere\":{},\"outdoors\":{},\"openings\":[",
                                   jsonNumber(openings.escaped), jsonNumber(openings.elsewhere), openings.outdoors);
    for (const RoomOpening& opening : openings.openings) {
        text += fmt::format(
            "{}{{\"kind\":\"{}\",\"share\":{},\"share_ci95\":{},\"share_bands\":{},\"rays\":{},\"center\":{},"
            "\"normal\":{},\"length\":{},\"width\":{},\"area\":{},\"boundary_edges\":{},\"beside\":[",
            &opening == openings.openings.data() ? "" : ",", kindOf(opening), jsonNumber(opening.meanFraction()),
            jsonNumber(opening.fractionCi95), jsonArray(opening.fraction), opening.rays, jsonPoint(opening.center),
            jsonPoint(opening.normal), jsonNumber(opening.length), jsonNumber(opening.width), jsonNumber(opening.area),
            opening.boundaryEdges);
        for (const RoomOpening::Beside& beside : opening.beside)
            text +=
                fmt::format("{}{{\"shape\":{},\"low\":{},\"high\":{}}}", &beside == opening.beside.data() ? "" : ",",
                            jsonString(beside.name), jsonPoint(beside.box.low), jsonPoint(beside.box.high));
        text += "]}";
    }
    return text + "]}";
}

std::string lossesText(const RoomReport& report) {
    std::string text;
    for (const RoomReport::Losses& losses : report.losses) {
        if (!losesSome(losses)) continue;
        if (text.empty()) text = "\nsound that leaves the room, of all that a source emits\n";
        text += fmt::format("  {}: {}\n", printable(losses.source), percentText(losses.openings.escaped));
        for (const RoomOpening& opening : losses.openings.openings)
            text += fmt::format("    {:<8} {:>8} +- {:<8} {} ({:.3g} m2) at {}; beside: {}\n", kindOf(opening),
                                percentText(opening.meanFraction()), percentText(opening.fractionCi95),
                                sizeText(opening), opening.area, centerText(opening.center), namesOf(opening));
        if (losses.openings.elsewhere > kNothing)
            text += fmt::format("    {:<8} {:>8}\n", "other", percentText(losses.openings.elsewhere));
    }
    return text;
}

std::string lossesHtml(const RoomReport& report) {
    std::string page;
    for (const RoomReport::Losses& losses : report.losses) {
        if (!losesSome(losses)) continue;
        if (page.empty()) page = "<h2>Sound that leaves the room</h2>\n";
        page += fmt::format(
            "<p>Of what {} emits {} leaves: by openings, and by leaks, which are small beside the room and hardly "
            "meant.</p>\n<table>\n<tr><th></th><th>Share</th><th>Size</th><th>Area, m&#178;</th><th>Centre, m</th>"
            "<th>Beside</th></tr>\n",
            escapeMarkup(printable(losses.source)), percentText(losses.openings.escaped));
        for (const RoomOpening& opening : losses.openings.openings)
            page += fmt::format(
                "<tr><th>{}</th><td>{} <i>&#177;{}</i></td><td>{}</td><td>{:.3g}</td><td>{}</td>"
                "<td>{}</td></tr>\n",
                kindOf(opening), percentText(opening.meanFraction()), percentText(opening.fractionCi95),
                sizeText(opening), opening.area, centerText(opening.center), escapeMarkup(printable(namesOf(opening))));
        if (losses.openings.elsewhere > kNothing)
            page += fmt::format("<tr><th>other</th><td>{}</td><td></td><td></td><td></td><td></td></tr>\n",
                                percentText(losses.openings.elsewhere));
        page += "</table>\n";
    }
    return page;
}

}  // namespace rtsg
