// Makes the page of a replay test: verdict, time line, first difference with its cause, curves, and pictures side by
// side.
#include <rtsg/session/replay_page.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/output_file.h>
#include <rtsg/core/web_address.h>
#include <rtsg/renderers/picture.h>

namespace rtsg {

namespace {

constexpr std::string_view kHead = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{0}</title><style>
:root {{ color-scheme: light dark; --ink: #1c2430; --soft: #5d6877; --line: #d5dae1; --bad: #b3261e; --good: #1a7f4b; --card: #f6f7f9 }}
@media (prefers-color-scheme: dark) {{ :root {{ --ink: #e6e9ee; --soft: #9aa5b4; --line: #3a424e; --bad: #ff8a80; --good: #7bd8a4; --card: #1d232b }} }}
body {{ font: 16px/1.5 system-ui, sans-serif; color: var(--ink); max-width: 960px; margin: 0 auto; padding: 16px }}
h1 {{ font-size: 1.4rem; margin: .2em 0 }} h2 {{ font-size: 1.1rem; margin: 1.6em 0 .4em }}
.soft {{ color: var(--soft); font-size: .9rem }} .bad {{ color: var(--bad) }} .good {{ color: var(--good) }}
.card {{ background: var(--card); border-left: 4px solid var(--bad); padding: 10px 14px; overflow-wrap: anywhere }}
code {{ font-family: ui-monospace, monospace; font-size: .92em }}
table {{ border-collapse: collapse; width: 100% }} td, th {{ text-align: left; padding: 4px 8px 4px 0; border-bottom: 1px solid var(--line); vertical-align: top }}
th {{ white-space: nowrap }} td {{ min-width: 3.5em; overflow-wrap: break-word }} td:nth-child(6), td:nth-child(7) {{ min-width: 14em }}
.lane {{ font-size: .85rem; overflow-wrap: anywhere }} .bar {{ position: relative; height: 8px; margin-bottom: 8px; background: #2f9e6859 }}
.bar i {{ position: absolute; top: 0; height: 8px; min-width: 2px; background: #d4573b }}
.ends {{ display: flex; justify-content: space-between; color: var(--soft); font-size: .85rem }}
.wide {{ overflow-x: auto }} svg {{ width: 100%; height: auto; display: block }}
.pictures {{ display: grid; grid-template-columns: repeat(auto-fit, minmax(240px, 1fr)); gap: 10px }}
figure {{ margin: 0 }} img {{ width: 100%; image-rendering: pixelated; border: 1px solid var(--line) }}
</style></head><body>
)";

constexpr const char* kColors[] = {"#3b6fd4", "#d4573b", "#2f9e68", "#8e5bd0"};

std::string verdict(const ReplayOutcome& o) {
    const ReplayReport& r = o.report;
    std::string text = fmt::format(
        "<h1>{} <span class=\"{}\">{}</span></h1>\n<p class=\"soft\">{} of {} states as recorded{} · {:.3f} s of scene "
        "time · ran in {:.2f} s · {:%Y-%m-%d %H:%M} UTC · rtsg {}<br>log <code>{}</code>{}</p>\n",
        escapeMarkup(o.name), o.passed() ? "good" : "bad", o.passed() ? "passed" : "failed", r.verified, r.frames,
        r.fields > 0 ? fmt::format(", {} field{}", r.fields, r.fields == 1 ? "" : "s") : "", r.end - r.start, o.seconds,
        fmt::gmtime(std::chrono::system_clock::to_time_t(std::chrono::system_clock::now())), RTSG_VERSION,
        escapeMarkup(o.log), o.scene.empty() ? "" : fmt::format(" · scene <code>{}</code>", escapeMarkup(o.scene)));
    for (const ReplayCheck& check : o.checks) {
        if (check.failure.empty() || (check.name == "states" && r.divergence))
            continue;  // that has its own place on the page
        text += fmt::format("<p class=\"bad\">{}</p>\n", escapeMarkup(check.failure));
        if (!check.advice.empty()) text += fmt::format("<pre>{}</pre>\n", escapeMarkup(check.advice));
    }
    return text;
}

std::string firstDifference(const ReplayReport& r) {
    if (!r.divergence) return {};
    const Divergence& d = *r.divergence;
    std::string text = fmt::format(
        "<h2>What differed first</h2>\n<div class=\"card\"><b>{}{}{}</b> in state {}, t = {} s<br>{}",
        escapeMarkup(d.node), d.field.empty() ? "" : ".", escapeMarkup(d.field), d.frame, d.time, escapeMarkup(d.text));
    return text + "</div>\n";
}

/// One lane for each field, showing where it differed.
std::string timeLine(const ReplayReport& r) {
    struct Lane {
        std::string name;
        double from, to;
    };
    std::vector<Lane> lanes;
    const double length = r.end - r.start;
    if (!(length > 0)) return {};  // one time only, or none
    const auto fraction = [&](double t) { return std::clamp(t / length, 0.0, 1.0); };
    for (const FieldDifference& d : r.differences) {
        if (lanes.size() == 40) break;
        const double last =
            r.frames > 1 ? fraction(d.time) + static_cast<double>(d.last - d.frame + 1) / static_cast<double>(r.frames)
                         : 1;
        lanes.push_back({d.node + "." + d.field, fraction(d.time), std::min(last, 1.0)});
    }
    if (lanes.empty() && r.divergence) lanes.push_back({"all fields", fraction(r.divergence->time), 1});
    if (lanes.empty()) return {};
    std::string text = "<h2>Time line</h2>\n<div role=\"img\" aria-label=\"time line\">\n";
    for (const Lane& lane : lanes)
        text += fmt::format(
            "<div class=\"lane\">{}</div><div class=\"bar\"><i style=\"left:{:.2f}%;width:{:.2f}%\"></i></div>\n",
            escapeMarkup(lane.name), 100 * std::min(lane.from, .997), 100 * std::max(lane.to - lane.from, 0.0));
    return text + fmt::format("<div class=\"ends\"><span>0 s</span><span>{:.3g} s</span></div></div>\n", length);
}

std::string curve(const FieldHistory& h, double start) {
    double low = 1e300, high = -1e300;
    for (const FieldHistory::Sample& s : h.samples)
        for (int k = 0; k < h.components; ++k)
            for (const float v : {s.a[static_cast<std::size_t>(k)], s.b[static_cast<std::size_t>(k)]})
                if (std::isfinite(v)) low = std::min(low, double(v)), high = std::max(high, double(v));
    if (!(high >= low)) return {};
    const double span = high > low ? high - low : 1, t0 = h.samples.front().time;
    const double duration = h.samples.back().time - t0;
    if (!(duration > 0)) return {};
    // The words stand beside the drawing, because they would shrink with it on a narrow page.
    std::string svg = fmt::format(
        "<h3><code>{}.{}</code></h3>\n<p class=\"soft\">{:.4g} to {:.4g}</p>\n<svg viewBox=\"0 0 720 170\" "
        "role=\"img\" "
        "aria-label=\"values over time\">\n",
        escapeMarkup(h.node), escapeMarkup(h.field), low, high);
    for (int k = 0; k < h.components; ++k)
        for (const bool now : {false, true}) {
            std::string points;
            for (const FieldHistory::Sample& s : h.samples) {
                const double v = (now ? s.b : s.a)[static_cast<std::size_t>(k)];
                if (std::isfinite(v))
                    points +=
                        fmt::format("{:.1f},{:.1f} ", 720 * (s.time - t0) / duration, 165 - 155 * (v - low) / span);
            }
            svg += fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\"{}/>\n", points,
                               kColors[k], now ? " stroke-dasharray=\"5 4\"" : " opacity=\".55\"");
        }
    return svg + fmt::format("</svg>\n<div class=\"ends\"><span>{:.3g} s</span><span>{:.3g} s</span></div>\n",
                             t0 - start, t0 + duration - start);
}

std::string curves(const ReplayReport& r, double start) {
    std::string text;
    for (std::size_t i = 0; i < std::min<std::size_t>(r.histories.size(), 6); ++i) text += curve(r.histories[i], start);
    if (text.empty()) return text;
    return "<h2>Values</h2>\n<p class=\"soft\">Solid: recorded. Dashed: now. One colour a component.</p>\n" + text;
}

std::string table(const ReplayReport& r) {
    if (r.differences.empty()) return {};
    std::string text = fmt::format(
        "<h2>{} field{} differed</h2>\n<div class=\"wide\"><table><tr><th>Field<th>From state<th>t, "
        "s<th>States<th>Largest<th>At first<th>By</tr>\n",
        r.differences.size(), r.differences.size() == 1 ? "" : "s");
    constexpr std::size_t kMax = 200;
    for (std::size_t i = 0; i < std::min(r.differences.size(), kMax); ++i) {
        const FieldDifference& d = r.differences[i];
        text += fmt::format("<tr><td><code>{}.{}</code><td>{}<td>{:.4g}<td>{}<td>{}<td>{}<td>{}</tr>\n",
                            escapeMarkup(d.node), escapeMarkup(d.field), d.frame, d.time, d.states,
                            std::isinf(d.largest) ? "–" : fmt::format("{:.4g}", d.largest), escapeMarkup(d.text),
                            escapeMarkup(d.cause));
    }
    text += "</table></div>\n";
    if (r.differences.size() > kMax) text += fmt::format("<p class=\"soft\">The first {} are listed.</p>\n", kMax);
    return text;
}

std::string readSmallFile(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

/// Puts a picture into the page as PNG. If it cannot be read, the page says so in its place.
std::string pageFigure(const Result<Picture>& picture, std::string_view caption, const ToneMap& toneMap = {}) {
    std::string body;
    if (!picture) {
        body = fmt::format("<p class=\"bad\">{}</p>", escapeMarkup(picture.error().format()));
    } else {
        std::error_code error;
        const std::filesystem::path file =
            freshNameBeside(std::filesystem::temp_directory_path(error) / "rtsg-page.png");
        Result<> written = writePicture(*picture, file, toneMap);
        std::string bytes;
        if (written) bytes = readSmallFile(file);
        std::filesystem::remove(file, error);
        body = written ? fmt::format("<img alt=\"{}\" src=\"data:image/png;base64,{}\">", caption,
                                     base64(std::as_bytes(std::span(bytes))))
                       : fmt::format("<p class=\"bad\">{}</p>", escapeMarkup(written.error().format()));
    }
    return fmt::format("<figure>{}<figcaption class=\"soft\">{}</figcaption></figure>\n", body, caption);
}

/// Eight times the difference, so that small ones are visible.
Result<Picture> difference(const Result<Picture>& a, const Result<Picture>& b) {
    if (!a) return a;
    if (!b) return b;
    if (a->width != b->width || a->height != b->height)
        return fail(fmt::format("{} x {} and {} x {} pixels", a->width, a->height, b->width, b->height));
    Picture result(a->width, a->height, Vec4f(0, 0, 0, 1));
    result.space = a->space;
    for (std::size_t i = 0; i < result.pixels.size(); ++i)
        for (int k = 0; k < 3; ++k)
            result.pixels[i][k] = std::min(8 * std::abs(a->pixels[i][k] - b->pixels[i][k]), 1.f);
    return result;
}

std::string pictures(const ReplayOutcome& o) {
    const auto side = [](std::string_view which, const Result<Picture>& expected, const Result<Picture>& rendered,
                         const ToneMap& toneMap = {}) {
        return fmt::format("<h2>Pictures of {}</h2>\n<div class=\"pictures\">{}{}{}</div>\n", which,
                           pageFigure(expected, "expected", toneMap), pageFigure(rendered, "now", toneMap),
                           pageFigure(difference(expected, rendered), "difference, 8 times"));
    };
    if (!o.expectedPicture.empty())
        return side("the last state", readPicture(o.expectedPicture), readPicture(o.createdPicture));
    if (!o.differing) return {};
    return side(fmt::format("state {}, the first that differed", o.differing->state), o.differing->expected,
                o.differing->rendered, o.differing->toneMap);
}

}  // namespace

bool ReplayOutcome::passed() const {
    return report.passed() && std::ranges::all_of(checks, [](const ReplayCheck& c) { return c.failure.empty(); });
}

std::string replayPage(const ReplayOutcome& outcome) {
    const ReplayReport& report = outcome.report;
    return fmt::format(kHead, escapeMarkup(outcome.name)) + verdict(outcome) + firstDifference(report) +
           timeLine(report) + curves(report, 0) + pictures(outcome) + table(report) + "</body></html>\n";
}

std::string junitXml(const ReplayOutcome& outcome) {
    const auto failed = std::ranges::count_if(outcome.checks, [](const ReplayCheck& c) { return !c.failure.empty(); });
    std::string xml = fmt::format(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n<testsuite name=\"{}\" tests=\"{}\" "
        "failures=\"{}\" errors=\"0\" skipped=\"0\" time=\"{:.3f}\" timestamp=\"{:%Y-%m-%dT%H:%M:%S}\">\n",
        escapeMarkup(outcome.name), outcome.checks.size(), failed, outcome.seconds,
        fmt::gmtime(std::chrono::system_clock::to_time_t(std::chrono::system_clock::now())));
    for (const ReplayCheck& check : outcome.checks) {
        xml += fmt::format("<testcase classname=\"{}\" name=\"{}\" time=\"{:.3f}\"", escapeMarkup(outcome.name),
                           escapeMarkup(check.name), &check == &outcome.checks.front() ? outcome.seconds : 0.0);
        if (check.failure.empty()) {
            xml += "/>\n";
            continue;
        }
        xml += fmt::format(">\n<failure message=\"{}\">", escapeMarkup(check.failure));
        if (check.name == "states")
            for (const FieldDifference& d : outcome.report.differences)
                xml += escapeMarkup(fmt::format("{}.{} from state {} (t = {} s), {} states: {}{}{}\n", d.node, d.field,
                                                d.frame, d.time, d.states, d.text, d.cause.empty() ? "" : ", by ",
                                                d.cause));
        xml += escapeMarkup(check.advice) + "</failure>\n</testcase>\n";
    }
    return xml + "</testsuite>\n</testsuites>\n";
}

}  // namespace rtsg
