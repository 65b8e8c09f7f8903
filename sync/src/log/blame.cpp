// Plays a log and notes each state in which one field changed, with what led to it.
#include <rtsg/sync/blame.h>

#include <optional>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/world.h>
#include <rtsg/sync/log_check.h>

#include "cause.h"

namespace rtsg {

Result<std::vector<FieldStep>> blame(const std::filesystem::path& log, std::string_view path,
                                     const std::function<bool(std::uint64_t, std::uint64_t)>& progress,
                                     std::optional<Divergence>* lacks) {
    auto opened = Replayer::open(log);
    if (!opened) return std::unexpected(opened.error());
    Replayer& replayer = **opened;
    LogCheck check(replayer);
    std::vector<FieldStep> steps;
    Diagnostic why;
    bool known = false;
    std::optional<Value> before;
    while (true) {
        const auto more = check.step();
        if (!more) continue;  // it goes on with the next keyframe
        if (!*more) break;
        if (progress && !progress(replayer.log().position(), replayer.log().size())) return steps;
        const Scene& scene = replayer.scene();
        const auto place = findField(scene, path);
        if (!place) {
            if (!known) why = place.error();
            before.reset();
            continue;
        }
        known = true;
        const Node& node = scene.node(place->node);
        if (!node.type().fields[place->field].readable())
            return fail(fmt::format("{} holds no value: it is an event", path));
        const Value now = node.value(place->field);
        if (now == before) continue;
        before = now;
        FieldStep step;
        step.state = scene.sequence();
        step.time = replayer.time();
        step.value = fieldText(scene, path).value_or("");
        if (replayer.lastSet().isSnapshot()) {
            step.cause = "as the log begins, or goes on";
        } else {
            FrameTouches touched;
            touched.add(replayer.lastSet());
            auto [cause, author] = touched.cause(scene, place->node, place->field);
            step.cause = std::move(cause);
            step.author = std::move(author);
        }
        steps.push_back(std::move(step));
    }
    if (lacks) *lacks = check.first();
    if (!known) return std::unexpected(std::move(why));
    return steps;
}

}  // namespace rtsg
