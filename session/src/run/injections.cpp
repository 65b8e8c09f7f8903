// --set: parses events with their times, and sends events that are due.
#include "run/injections.h"

#include <algorithm>
#include <sstream>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/x3d.h>
#include <rtsg/session/moments.h>

namespace rtsg {

namespace {

std::vector<std::string> wordsOf(const std::string& text) {
    std::vector<std::string> words;
    std::istringstream in(text);
    for (std::string word; in >> word;) words.push_back(word);
    return words;
}

Result<std::vector<double>> numbersOf(const std::vector<std::string>& words, std::size_t from) {
    std::vector<double> numbers;
    for (std::size_t i = from; i < words.size(); ++i) {
        auto value = parseFieldText(FieldType::SFDouble, words[i]);
        if (!value) return std::unexpected(value.error());
        numbers.push_back(value->as<double>());
    }
    return numbers;
}

using Root = x3d::RtsgScene;

}  // namespace

void Injections::add(FieldIndex field, Value value, double time) {
    all_.push_back({time, {}, {}, {}, {scene_->root(), field}, std::move(value), false});
}

Result<> Injections::parsePointer(const std::vector<std::string>& words, double time) {
    std::size_t i = 0;
    std::int32_t device = 0;
    if (!words.empty() && words[0].ends_with(':')) {
        const auto number = parseFieldText(FieldType::SFInt32, words[i++].substr(0, words[0].size() - 1));
        if (!number) return std::unexpected(number.error());
        device = number->as<std::int32_t>();
        if (device < 0 || device >= PointerInput::kDevices)
            return fail(fmt::format("pointers are 0 to {}", PointerInput::kDevices - 1));
    }
    PointerInput& input = pointers_[device];
    input.device = device;
    const bool known = input.buttons != 0 || pointed_.contains(device);
    if (i < words.size() && (words[i] == "down" || words[i] == "up"))
        input.buttons = words[i++] == "down" ? PointerInput::kPrimary : 0;
    if (i + 1 == words.size() && words[i] == "leave") {
        input.kind = PointerInput::Kind::absent;
    } else if (i < words.size() || !known) {
        const std::vector<double> n = numbersOf(words, i).value_or(std::vector<double>());
        if (n.size() == 6) {
            input.kind = PointerInput::Kind::ray;
            input.origin = {n[0], n[1], n[2]};
            input.direction = {n[3], n[4], n[5]};
        } else if (n.size() == 2 || n.size() == 3) {
            input.kind = PointerInput::Kind::picture;
            input.x = n[0];
            input.y = n[1];
            input.aspect = n.size() == 3 ? n[2] : 16.0 / 9;
        } else {
            return fail(
                "a pointer is [NUMBER:] [down|up] and X Y [ASPECT] in the picture, from 0 (left, top) to 1, or "
                "X Y Z DX DY DZ of a bearing, or leave");
        }
    }
    pointed_.insert(device);
    add(Root::pointer.index, Value(input.toValue()), time);
    return {};
}

Result<> Injections::parseKey(const std::vector<std::string>& words, double time) {
    const bool down = words.size() == 2 && words[0] == "down", up = words.size() == 2 && words[0] == "up";
    if (words.empty() || words.size() > 2 || (words.size() == 2 && !down && !up))
        return fail("a key is [down|up] NAME");
    for (const bool pressed : {true, false}) {
        if (pressed ? up : down) continue;
        const auto key = KeyInput::named(words.back(), pressed);
        if (!key) return std::unexpected(key.error());
        add(Root::key.index, Value(key->toValue()), time);
    }
    return {};
}

Result<> Injections::parseDevice(const std::string& name, const std::string& given, double time) {
    const std::vector<std::string> words = wordsOf(given);
    if (name == "pointer") return parsePointer(words, time);
    if (name == "key") return parseKey(words, time);
    if (name == "text") {
        std::string text = given;
        for (std::size_t at; (at = text.find("\\n")) != std::string::npos;) text.replace(at, 2, "\n");
        add(Root::text.index, Value(String(text)), time);
        return {};
    }
    const auto numbers = numbersOf(words, 0);
    const bool wheel = name == "wheel";
    if (!numbers || numbers->size() != (wheel ? 2u : 7u))
        return fail(wheel ? "a wheel has 2 numbers, its steps X Y"
                          : "a head has 7 numbers, X Y Z and a rotation AX AY AZ RADIANS");
    add(wheel ? Root::wheel.index : Root::headPose.index, Value(Array<double>(std::span<const double>(*numbers))),
        time);
    return {};
}

Result<> Injections::parseOne(const std::string& text, const std::string& name, const std::string& given, double time) {
    for (const std::string_view device : {"pointer", "key", "text", "wheel", "head"}) {
        if (name != device) continue;
        if (auto ok = parseDevice(name, given, time); !ok) return fail(fmt::format("{}: {}", text, ok.error().text));
        return {};
    }
    auto event = toField(text, name, given, time);
    if (!event) return std::unexpected(event.error());
    all_.push_back(std::move(*event));
    return {};
}

Result<Injections::Injection> Injections::toField(const std::string& text, const std::string& name,
                                                  const std::string& given, double time) const {
    const auto target = findField(*scene_, name);
    if (!target) return std::unexpected(target.error());
    const FieldDef& def = scene_->node(target->node).type().fields[target->field];
    if (!def.writable()) return fail(fmt::format("{}: {} takes no events", text, def.name));
    if (def.type == FieldType::SFTime && given == "now")
        return Injection{time, text, name, given, *target, Value(Time{0}), true};
    auto value = parseFieldText(def.type, given, TextSyntax::classicVrml, def.custom.get());
    if (!value) return fail(fmt::format("{}: {}", text, value.error().text));
    return Injection{time, text, name, given, *target, std::move(*value), false};
}

Result<Injections> Injections::parse(Scene& scene, const std::vector<std::string>& texts) {
    Injections result;
    result.scene_ = &scene;
    struct Given {
        double time = 0;
        std::string text, name, value;
    };
    std::vector<Given> all;
    for (const std::string& text : texts) {
        const auto equals = text.find('='), at = text.rfind('@');
        if (equals == std::string::npos || at == std::string::npos || at < equals)
            return fail(fmt::format("{}: expected DEF.field=VALUE@TIME or DEVICE=WHAT@TIME", text));
        const auto time = momentIn(text.substr(at + 1), scene.now());
        if (!time) return std::unexpected(time.error());
        all.push_back({*time, text, text.substr(0, equals), text.substr(equals + 1, at - equals - 1)});
    }
    // Sorted by time, since an event takes omitted values from the one before.
    std::ranges::stable_sort(all, {}, &Given::time);
    for (const Given& one : all) {
        const std::size_t first = result.all_.size();
        if (auto ok = result.parseOne(one.text, one.name, one.value, one.time); !ok) return std::unexpected(ok.error());
        for (std::size_t i = first; i < result.all_.size(); ++i) result.all_[i].text = one.text;
    }
    return result;
}

Result<> Injections::checkWithin(double end) const {
    const auto late = std::ranges::find_if(all_, [end](const Injection& i) { return i.time > end; });
    if (late == all_.end()) return {};
    return fail(fmt::format("--set ...@{}: that is after the end, {} s", late->time, end));
}

const Injections::Injection* Injections::findInput() const {
    const auto input = std::ranges::find_if(all_, [this](const Injection& i) {
        return scene_->node(i.target.node).type().fields[i.target.field].access == Access::inputOnly;
    });
    return input == all_.end() ? nullptr : &*input;
}

const Injections::Injection* Injections::next(double t) {
    if (next_ == all_.size() || all_[next_].time > t) return nullptr;
    Injection& due = all_[next_++];
    if (!due.name.empty())
        if (auto now = toField(due.text, due.name, due.given, due.time)) due = std::move(*now);
    return &due;
}

void Injections::sendUntil(double t, double start, const SessionContext& context) {
    while (const Injection* due = next(t)) {
        const bool isThere = scene_->find(due->target.node) != nullptr;
        const auto sent =
            scene_->sendEvent(due->target.node, due->target.field, due->isNow ? Value(Time{start + t}) : due->value);
        if (sent) continue;
        const std::string why = isThere ? sent.error().text : "its node is no longer there";
        context.report({Severity::error, {}, {}, fmt::format("{}: {}", due->text, why)});
        context.leftOut();
    }
}

}  // namespace rtsg
