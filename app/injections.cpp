// --set: parses events with their times, and sends those that are due.
#include "injections.h"

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>

namespace rtsg::app {

Result<Injections::Injection> Injections::parseOne(const Scene& scene, const std::string& text) {
    const auto equals = text.find('='), at = text.rfind('@');
    if (equals == std::string::npos || at == std::string::npos || at < equals)
        return fail(fmt::format("{}: expected DEF.field=VALUE@TIME", text));
    const auto target = findField(scene, text.substr(0, equals));
    if (!target) return std::unexpected(target.error());
    const FieldDef& def = scene.node(target->node).type().fields[target->field];
    if (!def.writable()) return fail(fmt::format("{}: {} takes no events", text, def.name));
    const std::string given = text.substr(equals + 1, at - equals - 1);
    const double time = parseSeconds(text.substr(at + 1));
    if (def.type == FieldType::SFTime && given == "now") return Injection{time, *target, Value(Time{0}), true};
    auto value = parseFieldText(def.type, given);
    if (!value) return fail(fmt::format("{}: {}", text, value.error().text));
    return Injection{time, *target, std::move(*value), false};
}

Result<Injections> Injections::parse(Scene& scene, const std::vector<std::string>& texts) {
    Injections result;
    result.scene_ = &scene;
    for (const std::string& text : texts) {
        auto injection = parseOne(scene, text);
        if (!injection) return std::unexpected(injection.error());
        result.all_.push_back(std::move(*injection));
    }
    std::ranges::stable_sort(result.all_, {}, &Injection::time);
    return result;
}

const Injections::Injection* Injections::next(double t) {
    return next_ < all_.size() && all_[next_].time <= t ? &all_[next_++] : nullptr;
}

void Injections::sendUntil(double t, double start) {
    while (const Injection* due = next(t))
        if (auto ok = scene_->sendEvent(due->target.node, due->target.field,
                                        due->isNow ? Value(Time{start + t}) : due->value);
            !ok)
            printError(ok.error().text);
}

}  // namespace rtsg::app
