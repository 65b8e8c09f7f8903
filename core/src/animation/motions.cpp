// HAnimMotion: ISO/IEC 19775-1 V4.0, 26.3.5, after ISO/IEC 19774-2 (motion data as BVH files have it). Plays rows of
// numbers, a row a frame, into the joints of the humanoids that it is in; nothing is interpolated between two frames.
//
// Where the clauses leave it open: rotations are in degrees, turned about the axes in the order in which the channels
// stand (BVH: the last one is done first); a position is the joint's `translation`; startFrame and endFrame of 0, as
// they are by default, mean all frames; each frame lasts frameDuration, the last one too.
#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>
#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/x3d.h>

#include <rtsg/core/rotation.h>
#include "behaviour/behaviours.h"
#include "humanoids.h"

namespace rtsg::behaviours {

namespace {

using M = x3d::HAnimMotion;
using J = x3d::HAnimJoint;

enum class Moves : std::uint8_t { position, rotation, scale, nothing };
struct Channel {
    Moves moves = Moves::nothing;
    int axis = 0;
};
/// The channels of one joint: those from `first` on, in a row of values.
struct Track {
    std::size_t first = 0, count = 0;
};
/// The motion data that `channels`, `joints` and `values` describe.
struct Sheet {
    std::vector<Channel> channels;
    std::vector<Track> tracks;
    std::vector<std::string_view> joints;  // as many as are named
    std::size_t frames = 0;
};

/// Words between blanks and commas.
std::vector<std::string_view> wordsOf(std::string_view text) {
    constexpr std::string_view kBetween = " \t\r\n,";
    std::vector<std::string_view> words;
    for (std::size_t at = text.find_first_not_of(kBetween); at != text.npos;) {
        const std::size_t end = std::min(text.find_first_of(kBetween, at), text.size());
        words.push_back(text.substr(at, end - at));
        at = text.find_first_not_of(kBetween, end);
    }
    return words;
}

std::optional<Channel> channelOf(std::string_view word) {
    if (word.size() < 2 || word[0] < 'X' || word[0] > 'Z') return {};
    const int axis = word[0] - 'X';
    if (word.substr(1) == "position") return Channel{Moves::position, axis};
    if (word.substr(1) == "rotation") return Channel{Moves::rotation, axis};
    if (word.substr(1) == "scale") return Channel{Moves::scale, axis};
    return {};
}

/// `2 Zrotation Xrotation 1 Zrotation ...`: each number says how many channels the next joint has.
void readChannels(Cascade& cascade, const Node& node, Sheet& sheet) {
    std::size_t missing = 0;  // of the joint before
    const auto report = [&](const std::string& text) { cascade.warn(node, "channels: " + text); };
    for (const std::string_view word : wordsOf(node.get(M::channels).view())) {
        std::size_t number = 0;
        const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
        if (error == std::errc() && end == word.data() + word.size()) {
            if (missing) report(fmt::format("{} fewer than said before \"{}\"", missing, word));
            sheet.tracks.push_back({sheet.channels.size(), 0});
            missing = number;
            continue;
        }
        if (!missing) report(fmt::format("\"{}\" is one more than said", word));
        if (sheet.tracks.empty()) continue;
        const auto channel = channelOf(word);
        if (!channel) report(fmt::format("\"{}\" is no channel: its numbers are passed over", word));
        sheet.channels.push_back(channel.value_or(Channel{}));
        ++sheet.tracks.back().count;
        if (missing) --missing;
    }
    if (missing) report(fmt::format("{} fewer than said at the end", missing));
}

Sheet readSheet(Cascade& cascade, const Node& node) {
    Sheet sheet;
    readChannels(cascade, node, sheet);
    sheet.joints = wordsOf(node.get(M::joints).view());
    if (sheet.joints.size() != sheet.tracks.size())
        cascade.warn(node,
                     fmt::format("joints names {}, and channels are of {}", sheet.joints.size(), sheet.tracks.size()));
    const std::size_t row = sheet.channels.size(), values = node.get(M::values).size();
    if (row) sheet.frames = std::min<std::size_t>(values / row, INT32_MAX);
    if (row ? values % row : values)
        cascade.warn(node, fmt::format("values has {} numbers, which are no whole frames of {}", values, row));
    return sheet;
}

/// The frames that are played, both included.
struct Range {
    std::int32_t low = 0, high = 0;
};
Range rangeOf(const Node& node, std::size_t frames) {
    const auto last = static_cast<std::int32_t>(frames) - 1;
    std::int32_t start = node.get(M::startFrame), end = node.get(M::endFrame);
    if (start == 0 && end == 0) end = last;
    start = std::clamp(start, 0, last), end = std::clamp(end, 0, last);
    return {std::min(start, end), std::max(start, end)};
}

/// `steps` steps on from `index`; how many of them began a cycle anew, and whether the end was passed without a loop.
struct Segment {
    std::int64_t index = 0, sinceCycle = 0, taken = 0;
    bool cycled = false, over = false;
};
Segment walk(std::int32_t index, std::int64_t step, std::int64_t steps, Range range, bool loop) {
    const std::int64_t size = std::abs(step), length = range.high - range.low;
    const std::int64_t left = (step > 0 ? range.high - index : index - range.low) / size;  // in this cycle
    if (steps <= left) return {index + steps * step, 0, steps};
    if (!loop) return {index + left * step, 0, left + 1, false, true};
    const std::int64_t round = length / size + 1, after = (steps - left - 1) % round;
    return {(step > 0 ? range.low : range.high) + after * step, after, steps, true};
}

// ---- into the joints -----------------------------------------------------------------------------------------

struct Row {
    const Sheet& sheet;
    std::span<const float> values;  // of the frame
    std::span<const bool> enabled;  // none said: they are
    bool counts(std::size_t channel) const { return channel >= enabled.size() || enabled[channel]; }
};

void poseJoint(Cascade& cascade, const Node& node, const Node& joint, const Row& row, Track track) {
    glm::dquat rotation(1, 0, 0, 0);
    Vec3f position = joint.get(J::translation), scale = joint.get(J::scale);
    bool moves[3] = {false, false, false};
    for (std::size_t i = track.first; i < track.first + track.count; ++i) {
        const Channel channel = row.sheet.channels[i];
        if (channel.moves == Moves::nothing || !row.counts(i)) continue;
        moves[static_cast<int>(channel.moves)] = true;
        const float value = row.values[i];
        if (channel.moves == Moves::position) position[channel.axis] = value;
        if (channel.moves == Moves::scale) scale[channel.axis] = value;
        glm::dvec3 axis(0);
        axis[channel.axis] = 1;
        if (channel.moves == Moves::rotation) rotation = rotation * rotationAround(axis, glm::radians(double(value)));
    }
    if (moves[static_cast<int>(Moves::position)]) setJoint(cascade, node, joint, J::translation, position);
    if (moves[static_cast<int>(Moves::rotation)]) setJoint(cascade, node, joint, J::rotation, toRotation(rotation));
    if (moves[static_cast<int>(Moves::scale)]) setJoint(cascade, node, joint, J::scale, scale);
}

bool isEnabledIn(const Scene& scene, const Node& humanoid, const Node& node) {
    using H = x3d::HAnimHumanoid;
    const auto motions = humanoid.get(H::motions).span();
    const auto& enabled = humanoid.get(H::motionsEnabled);
    for (std::size_t i = 0; i < motions.size(); ++i)
        if (scene.effectiveNode(motions[i]) == &node && (i >= enabled.size() || enabled[i])) return true;
    return false;
}

void poseHumanoids(Cascade& cascade, const Node& node, const Sheet& sheet, std::int32_t frame) {
    const Scene& scene = cascade.scene();
    // Keeps the values: the events that are sent here may write the field from which they are read.
    const auto values = node.get(M::values);
    const auto enabled = node.get(M::channelsEnabled);
    const Row row{sheet, values.span().subspan(std::size_t(frame) * sheet.channels.size(), sheet.channels.size()),
                  enabled.span()};
    forEachHumanoidOf(scene, node, x3d::HAnimHumanoid::motions.index, [&](const Node& humanoid) {
        if (!isEnabledIn(scene, humanoid, node)) return;
        const auto joints = jointsByName(scene, humanoid);
        std::vector<std::pair<const Node*, Track>> found;
        for (std::size_t i = 0; i < std::min(sheet.joints.size(), sheet.tracks.size()); ++i) {
            if (sheet.joints[i] == "IGNORED") continue;
            const auto joint = joints.find(sheet.joints[i]);
            if (joint != joints.end()) found.emplace_back(joint->second, sheet.tracks[i]);
        }
        if (found.empty()) cascade.warn(node, "none of its joints is among those of the humanoid");
        for (const auto& [joint, track] : found) poseJoint(cascade, node, *joint, row, track);
    });
}

// ---- its clock -----------------------------------------------------------------------------------------------

void beginMotion(Cascade& cascade, const Node& node, double duration) {
    cascade.store(node, M::_isPlaying, true);
    cascade.store(node, M::_isOver, false);
    cascade.store(node, M::_due, Time{cascade.now() + duration});
    cascade.emit(node, M::cycleTime, Time{cascade.now()});
    cascade.emit(node, M::elapsedTime, Time{0});
}

/// Returns the frame that it is at now.
std::int32_t goOnWithMotion(Cascade& cascade, const Node& node, std::int32_t index, Range range, double duration) {
    const double due = node.get(M::_due).seconds;
    const double steps = std::floor((cascade.now() - due) / duration) + 1;
    if (!(steps >= 1)) return index;
    const auto whole = static_cast<std::int64_t>(std::min(steps, 1e15));
    const Segment stretch = walk(index, node.get(M::frameIncrement), whole, range, node.get(M::loop));
    const double next = due + double(stretch.taken) * duration;
    cascade.emit(node, M::elapsedTime, Time{node.get(M::elapsedTime).seconds + double(stretch.taken) * duration});
    if (stretch.cycled) cascade.emit(node, M::cycleTime, Time{next - double(stretch.sinceCycle + 1) * duration});
    cascade.store(node, M::_due, Time{next});
    if (stretch.over) {
        cascade.store(node, M::_isPlaying, false);
        cascade.store(node, M::_isOver, true);
    }
    return static_cast<std::int32_t>(stretch.index);
}

double motionOnTime(Cascade& cascade, const Node& node) {
    const Sheet sheet = readSheet(cascade, node);
    const auto frames = static_cast<std::int32_t>(sheet.frames);
    if (node.get(M::frameCount) != frames) cascade.emit(node, M::frameCount, frames);
    const double duration = node.get(M::frameDuration).seconds;
    const bool enabled = node.get(M::enabled) && frames > 0;
    const bool plays = enabled && node.get(M::frameIncrement) != 0 && duration > 0 && std::isfinite(duration);
    if (!plays && node.get(M::_isPlaying)) cascade.store(node, M::_isPlaying, false);
    if (!enabled) return kNever;

    const Range range = rangeOf(node, sheet.frames);
    std::int32_t index = std::clamp(node.get(M::frameIndex), range.low, range.high);
    if (plays && node.get(M::_isOver) && node.get(M::loop))
        beginMotion(cascade, node, duration), index = node.get(M::frameIncrement) > 0 ? range.low : range.high;
    else if (plays && !node.get(M::_isPlaying) && !node.get(M::_isOver))
        beginMotion(cascade, node, duration);
    else if (node.get(M::_isPlaying))
        index = goOnWithMotion(cascade, node, index, range, duration);

    const bool shows = node.get(M::_isStale) || index != node.get(M::frameIndex);
    if (index != node.get(M::frameIndex)) cascade.emit(node, M::frameIndex, index);
    if (node.get(M::_isStale)) cascade.store(node, M::_isStale, false);
    if (shows) poseHumanoids(cascade, node, sheet, index);
    return node.get(M::_isPlaying) ? node.get(M::_due).seconds : kNever;
}

/// next and previous: a step, or with a frameIncrement of 0 one frame; where the range ends, on from its other end if
/// it loops.
void stepByHand(Cascade& cascade, const Node& node, int direction) {
    const auto frames = static_cast<std::size_t>(node.get(M::frameCount));
    if (!node.get(M::enabled) || frames == 0) return;
    const Range range = rangeOf(node, frames);
    const std::int64_t increment = node.get(M::frameIncrement);
    const Segment stretch = walk(std::clamp(node.get(M::frameIndex), range.low, range.high),
                                 (increment ? increment : 1) * direction, 1, range, node.get(M::loop));
    if (stretch.over) return;
    cascade.emit(node, M::frameIndex, static_cast<std::int32_t>(stretch.index));
    cascade.store(node, M::_isStale, true);
    cascade.store(node, M::_due, Time{cascade.now() + node.get(M::frameDuration).seconds});
}

void motionOnEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    if (field == M::next.index || field == M::previous.index) {
        if (value.as<bool>()) stepByHand(cascade, node, field == M::next.index ? 1 : -1);
        return;
    }
    if (field == M::enabled.index) {
        // Enabling a motion that has played to its end starts it again.
        if (!value.as<bool>() || !node.get(M::_isOver)) return;
        const Range range = rangeOf(node, static_cast<std::size_t>(std::max(node.get(M::frameCount), 1)));
        cascade.store(node, M::_isOver, false);
        cascade.emit(node, M::frameIndex, node.get(M::frameIncrement) < 0 ? range.high : range.low);
        cascade.store(node, M::_isStale, true);
        return;
    }
    if (field == M::frameIndex.index)
        cascade.store(node, M::_due, Time{cascade.now() + node.get(M::frameDuration).seconds});
    for (const FieldIndex shown : {M::frameIndex.index, M::channels.index, M::channelsEnabled.index, M::joints.index,
                                   M::values.index, M::startFrame.index, M::endFrame.index})
        if (field == shown) cascade.store(node, M::_isStale, true);
}

/// The humanoid's motions or joints have changed, so its motions show their frames again.
void humanoidOnEvent(Cascade& cascade, const Node& humanoid, FieldIndex field, EventValue) {
    using H = x3d::HAnimHumanoid;
    if (field != H::motions.index && field != H::motionsEnabled.index && field != H::joints.index) return;
    const Array<NodeId> motions(humanoid.get(H::motions));
    for (const NodeId id : motions.span()) {
        const Node* motion = cascade.scene().effectiveNode(id);
        if (!motion || !motion->is(M::type)) continue;
        cascade.store(*motion, M::_isStale, true);
        cascade.wake(*motion);
    }
}

}  // namespace

void forEachHumanoidOf(const Scene& scene, const Node& node, FieldIndex field,
                       const std::function<void(const Node&)>& visit) {
    constexpr int kMaxInstances = 64;  // a PROTO's body in a PROTO's body ...
    std::vector<NodeId> inside{node.id()}, found;
    for (int depth = 0; depth < kMaxInstances && !inside.empty(); ++depth) {
        std::vector<NodeId> next;
        for (const NodeId id : inside)
            for (const ParentRef& parent : scene.parents(id)) {
                const Node& holder = scene.node(parent.node);
                if (holder.is(x3d::HAnimHumanoid::type) && parent.field == field)
                    found.push_back(parent.node);
                else if (holder.type().body() != kNoField && scene.effectiveNode(parent.node) == &node)
                    next.push_back(parent.node);
            }
        inside = std::move(next);
    }
    std::ranges::sort(found);
    found.erase(std::unique(found.begin(), found.end()), found.end());
    for (const NodeId id : found)
        if (const Node* humanoid = scene.find(id)) visit(*humanoid);
}

std::unordered_map<std::string_view, const Node*> jointsByName(const Scene& scene, const Node& humanoid) {
    std::unordered_map<std::string_view, const Node*> joints;
    for (const NodeId id : humanoid.get(x3d::HAnimHumanoid::joints).span()) {
        const Node* joint = scene.effectiveNode(id);
        if (!joint || !joint->is(J::type) || joint->get(J::name).view().empty()) continue;
        joints.emplace(joint->get(J::name).view(), joint);
    }
    return joints;
}

void appendMotions(std::vector<BuiltinBehaviour>& table) {
    table.push_back({x3d::HAnimMotion::type, {.onEvent = motionOnEvent, .onTime = motionOnTime}});
    table.push_back({x3d::HAnimHumanoid::type, {.onEvent = humanoidOnEvent}});
}

}  // namespace rtsg::behaviours
