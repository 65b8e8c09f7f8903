// Writes advice as text for people and as JSON for programs.
#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>

#include "trials.h"

namespace rtsg {

using advice::figure;

namespace {

/// A number for JSON, which has no others.
std::string number(double value) {
    return std::isfinite(value) ? fmt::format("{:.6g}", value) : "null";
}

std::string strings(const std::vector<std::string>& list) {
    std::string text = "[";
    for (const std::string& item : list) text += (text.size() > 1 ? "," : "") + jsonString(item);
    return text + "]";
}

std::string numbers(const std::vector<double>& list) {
    std::string text = "[";
    for (const double item : list) text += (text.size() > 1 ? "," : "") + number(item);
    return text + "]";
}

std::string tableText(const AdviceTable& table) {
    std::size_t width = 7;
    for (const Trial& trial : table.trials) width = std::max(width, trial.setting.size());
    std::string text = fmt::format("{}\n", nameOf(table.sense));
    if (!table.trials.empty()) {
        text += fmt::format("  {:<{}}", "setting", width);
        for (const std::string& unit : table.costUnits) text += fmt::format("  {:>15}", unit);
        text += fmt::format("  {:>20}\n", "error, " + table.errorUnit);
    }
    for (const Trial& trial : table.trials) {
        text += fmt::format("  {:<{}}", trial.setting, width);
        for (const double cost : trial.costs) text += fmt::format("  {:>15}", figure(cost));
        text += fmt::format(
            "  {:>20}{}{}\n",
            trial.interval > 0 ? figure(trial.error) + " +- " + figure(trial.interval) : figure(trial.error),
            trial.predicted ? "  predicted" : "", trial.beaten ? "  beaten" : "");
    }
    text += "  " + table.how + "\n";
    for (const std::string& sentence : table.sentences) text += "- " + sentence + "\n";
    return text;
}

}  // namespace

std::string Advice::toText() const {
    std::string text;
    for (const AdviceTable& table : tables) text += tableText(table) + "\n";
    return text +
           fmt::format(
               "{}: measured in {} s, with {} CPU-s. Beaten: another setting is no worse in any cost and in error, and "
               "surely better in one.\n",
               scene, figure(seconds), figure(cpuSeconds));
}

std::string Advice::toJson() const {
    std::string text = fmt::format("{{\"scene\":{},\"seconds\":{},\"cpu_seconds\":{},\"tables\":[", jsonString(scene),
                                   number(seconds), number(cpuSeconds));
    bool first = true;
    for (const AdviceTable& table : tables) {
        text += fmt::format("{}{{\"for\":\"{}\",\"cost_units\":{},\"error_unit\":{},\"how\":{},\"trials\":[",
                            first ? "" : ",", nameOf(table.sense), strings(table.costUnits),
                            jsonString(table.errorUnit), jsonString(table.how));
        first = false;
        bool begun = false;
        for (const Trial& trial : table.trials) {
            text +=
                fmt::format("{}{{\"setting\":{},\"costs\":{},\"error\":{},\"ci95\":{},\"predicted\":{},\"beaten\":{}}}",
                            begun ? "," : "", jsonString(trial.setting), numbers(trial.costs), number(trial.error),
                            number(trial.interval), trial.predicted, trial.beaten);
            begun = true;
        }
        text += fmt::format("],\"advice\":{}}}", strings(table.sentences));
    }
    return text + fmt::format("],\"missing\":{}}}", strings(missing));
}

}  // namespace rtsg
