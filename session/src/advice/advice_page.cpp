// Writes advice as a page, and its diagrams of error against cost as SVG.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>

#include "trials.h"

namespace rtsg {

using advice::figure;

namespace {

constexpr double kWidth = 720, kHeight = 360, kLeft = 70, kRight = 30, kTop = 34, kBottom = 50;

/// Lays positive numbers out by their logarithms. Those that are 0 lie on the edge below all others.
class LogScale {
  public:
    LogScale(const std::vector<double>& values, double from, double to) : from_(from), to_(to) {
        low_ = 1e300, high_ = 0;
        for (const double value : values)
            if (std::isfinite(value) && value > 0) low_ = std::min(low_, value), high_ = std::max(high_, value);
        if (high_ <= 0) low_ = high_ = 1;
        low_ /= 1.5, high_ *= 1.5;
    }
    double operator()(double value) const {
        if (!(value > 0)) return from_;
        return from_ + (to_ - from_) * (std::log(value) - std::log(low_)) / (std::log(high_) - std::log(low_));
    }
    std::vector<double> marks() const {
        std::vector<double> all;
        for (double power = std::floor(std::log10(low_)); power <= std::ceil(std::log10(high_)); ++power)
            for (const double step : {1.0, 2.0, 5.0}) {
                const double mark = step * std::pow(10, power);
                if (mark >= low_ && mark <= high_ && (step == 1 || high_ / low_ < 100)) all.push_back(mark);
            }
        return all;
    }

  private:
    double from_, to_, low_, high_;
};

std::string label(double x, double y, const char* anchor, const std::string& text) {
    return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>\n", x, y, anchor,
                       escapeMarkup(text));
}

/// Error against the first cost, `top` below the beginning of the picture.
std::string diagram(const AdviceTable& table, double top) {
    std::vector<double> costs, errors;
    for (const Trial& trial : table.trials) costs.push_back(trial.costs[0]), errors.push_back(trial.error);
    const double bottom = top + kHeight - kBottom;
    const LogScale x(costs, kLeft, kWidth - kRight), y(errors, bottom, top + kTop);
    std::string svg = label(
        kLeft, top + 18, "start",
        fmt::format("{}: error ({}) against cost ({})", nameOf(table.sense), table.errorUnit, table.costUnits[0]));
    for (const double mark : x.marks())
        svg += fmt::format("<path d=\"M{0:.1f} {1:.1f}V{2:.1f}\" stroke=\"#d5dae1\"/>\n", x(mark), top + kTop, bottom) +
               label(x(mark), bottom + 18, "middle", figure(mark));
    for (const double mark : y.marks())
        svg += fmt::format("<path d=\"M{0:.1f} {1:.1f}H{2:.1f}\" stroke=\"#d5dae1\"/>\n", kLeft, y(mark),
                           kWidth - kRight) +
               label(kLeft - 8, y(mark) + 4, "end", figure(mark));
    for (const Trial& trial : table.trials) {
        if (!std::isfinite(trial.error)) continue;
        const char* color = trial.beaten ? "#8a94a2" : "#0072b2";
        if (trial.interval > 0 && std::isfinite(trial.interval))
            svg += fmt::format("<path d=\"M{0:.1f} {1:.1f}V{2:.1f}\" stroke=\"{3}\"/>\n", x(trial.costs[0]),
                               std::clamp(y(trial.error - trial.interval), top + kTop, bottom),
                               std::clamp(y(trial.error + trial.interval), top + kTop, bottom), color);
        svg += fmt::format(
            "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"5\" stroke=\"{}\" fill=\"{}\"><title>{}: {}, error "
            "{}{}</title></circle>\n",
            x(trial.costs[0]), y(trial.error), color, trial.predicted ? "white" : color, escapeMarkup(trial.setting),
            figure(trial.costs[0]), figure(trial.error), trial.beaten ? ", beaten" : "");
    }
    return svg;
}

bool isDrawn(const AdviceTable& table) {
    return !table.trials.empty();
}

std::string drawing(const std::vector<const AdviceTable*>& tables) {
    std::string svg = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:g} {1:g}\" width=\"{0:g}\" height=\"{1:g}\" "
        "font-family=\"sans-serif\" "
        "font-size=\"13\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        kWidth, std::max(1.0, kHeight * static_cast<double>(tables.size())));
    for (std::size_t i = 0; i < tables.size(); ++i) svg += diagram(*tables[i], kHeight * static_cast<double>(i));
    return svg + "</svg>\n";
}

std::string section(const AdviceTable& table) {
    std::string html = fmt::format("<h2>{}</h2>\n<ul>\n", nameOf(table.sense));
    for (const std::string& sentence : table.sentences) html += "<li>" + escapeMarkup(sentence) + "</li>\n";
    html += "</ul>\n";
    if (!isDrawn(table)) return html + "<p>" + escapeMarkup(table.how) + "</p>\n";
    html += "<table><tr><th>setting</th>";
    for (const std::string& unit : table.costUnits) html += "<th>" + escapeMarkup(unit) + "</th>";
    html += "<th>error, " + escapeMarkup(table.errorUnit) + "</th><th></th></tr>\n";
    for (const Trial& trial : table.trials) {
        html += fmt::format("<tr{}><td><code>{}</code></td>", trial.beaten ? " class=\"beaten\"" : "",
                            escapeMarkup(trial.setting));
        for (const double cost : trial.costs) html += "<td>" + figure(cost) + "</td>";
        html += fmt::format("<td>{}{}</td><td>{}{}</td></tr>\n", figure(trial.error),
                            trial.interval > 0 ? " ± " + figure(trial.interval) : "",
                            trial.predicted ? "predicted " : "", trial.beaten ? "beaten" : "");
    }
    return html + "</table>\n<p>" + escapeMarkup(table.how) + "</p>\n" + drawing({&table});
}

}  // namespace

std::string Advice::toSvg() const {
    std::vector<const AdviceTable*> drawn;
    for (const AdviceTable& table : tables)
        if (isDrawn(table)) drawn.push_back(&table);
    return drawing(drawn);
}

std::string Advice::toHtml() const {
    std::string html = fmt::format(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Advice for {0}</title>\n<style>body "
        "{{ font: 16px/1.5 system-ui, "
        "sans-serif; max-width: 780px; margin: 0 auto; padding: 16px }} td, th {{ text-align: left; padding: 2px 12px "
        "2px 0 }} .beaten {{ color: "
        "#777 }} svg {{ max-width: 100%; height: auto }}</style></head><body>\n<h1>{0}</h1>\n",
        escapeMarkup(scene));
    for (const std::string& text : missing) html += "<p><b>Missing: " + escapeMarkup(text) + "</b></p>\n";
    for (const AdviceTable& table : tables) html += section(table);
    return html + fmt::format(
                      "<p>Measured in {} s, with {} CPU-s. Beaten: another setting is no worse in any cost and in "
                      "error, and surely better in "
                      "one.</p>\n</body></html>\n",
                      figure(seconds), figure(cpuSeconds));
}

}  // namespace rtsg
